# Fault plans under a real kernel: those bodies of tests/usb in which the kernel has a part.
guest_tests --gtest_filter='Faults/*' --gtest_brief=0
