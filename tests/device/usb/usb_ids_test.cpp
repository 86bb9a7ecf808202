// What must agree with device/usb/usb_ids.h, and what the errors of the operating system become.
#include "device/usb/usb_ids.h"

#include <cerrno>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "base/env.h"
#include "device/usb/usb_errors.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

std::string text_of(const std::string& name) {
  const std::ifstream file(std::string(SIXPOINT_SOURCE_DIR "/packaging/udev/") + name);
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_FALSE(text.str().empty()) << name;
  return text.str();
}

TEST(UsbIds, TheDetectionRulesKnowEveryProductAndNoOther) {
  const std::string rules = text_of(kDetectionRules);
  std::set<std::pair<std::string, std::string>> in_rules;
  const std::regex rule(R"re(ATTRS?\{idVendor\}=="(\w+)", ATTRS?\{idProduct\}=="(\w+)")re");
  for (std::sregex_iterator found(rules.begin(), rules.end(), rule), end; found != end; ++found) {
    in_rules.emplace((*found)[1], (*found)[2]);
  }
  std::set<std::pair<std::string, std::string>> in_header;
  const auto hex = [](std::uint16_t id) {
    std::array<char, 5> text{};
    std::snprintf(text.data(), text.size(), "%04x", id);
    return std::string(text.data());
  };
  for (const UsbProduct& product : kUsbProducts) {
    in_header.emplace(hex(kUsbVendorId), hex(product.product_id));
  }
  EXPECT_EQ(in_rules, in_header);
  EXPECT_EQ(rules.find("TAG"), std::string::npos) << "detection grants nothing";
  EXPECT_EQ(rules.find("MODE"), std::string::npos) << "detection grants nothing";
}

TEST(UsbIds, TheAccessRulesAskForWhatDetectionSets) {
  const std::string rules = text_of(kAccessRules);
  EXPECT_NE(rules.find(R"(ENV{ID_SIXPOINT}=="?*", TAG+="uaccess")"), std::string::npos);
  EXPECT_EQ(rules.find("idVendor"), std::string::npos) << "policy names no ids";
  EXPECT_LT(std::string(kAccessRules).substr(0, 2), "73") << "where systemd grants uaccess";
}

TEST(UsbErrors, EachSaysWhatToDo) {
  const auto of = [](int number) { return usb_error(number, "cannot", "/dev/hidraw7").value(); };
  EXPECT_EQ(of(EACCES).code, ErrorCode::permission);
  EXPECT_EQ(of(EPERM).code, ErrorCode::permission);
  EXPECT_NE(of(EACCES).hint.find(kAccessRules), std::string::npos);
  EXPECT_EQ(of(EBUSY).code, ErrorCode::device_unavailable);
  EXPECT_EQ(of(ENODEV).code, ErrorCode::device_unavailable);
  EXPECT_EQ(of(ENOENT).code, ErrorCode::device_unavailable);
  EXPECT_EQ(of(ESHUTDOWN).code, ErrorCode::device_unavailable);
  EXPECT_EQ(of(EPIPE).code, ErrorCode::io);
  EXPECT_EQ(of(ETIMEDOUT).code, ErrorCode::io);
  EXPECT_EQ(of(EOVERFLOW).code, ErrorCode::bad_data);
  EXPECT_EQ(of(EPROTO).code, ErrorCode::io);
  std::set<std::string> sentences;
  for (const int number : {EACCES, EBUSY, ENODEV, EPIPE, ETIMEDOUT, EOVERFLOW, EPROTO}) {
    EXPECT_EQ(of(number).where, "/dev/hidraw7");
    EXPECT_FALSE(of(number).hint.empty());
    sentences.insert(of(number).what);
  }
  EXPECT_EQ(sentences.size(), 7U) << "each is told apart";
}

}  // namespace
}  // namespace sixpoint::device
