# What only a real kernel can answer.
guest_tests --gtest_filter='Kernel.*'
