# The bodies of tests/usb, the same as over umockdev.
guest_tests --gtest_filter='Usb/*' --gtest_brief=0
