# Fault plans under a real kernel.
guest_tests --gtest_filter='Faults.*'
