// The certificate as a document of A4 pages.
#include <algorithm>
#include <cctype>
#include <cmath>

#include <fmt/format.h>

#include "station/certificate/certificate.h"
#include "station/certificate/page_flow.h"
#include "station/certificate/qr_code.h"

namespace sixpoint::station {

namespace {

constexpr double kQr_mm = 25;
constexpr TextStyle kStrong{PdfFont::bold, 8};
constexpr TextStyle kMono{PdfFont::mono, 8};
constexpr TextStyle kReason{PdfFont::regular, 7.2};
constexpr std::string_view kDash = "\u2013";

// Value and uncertainty to the uncertainty's second digit (GUM 7.2.6).
int decimals_for(double uncertainty) {
  return uncertainty > 0 && std::isfinite(uncertainty)
             ? std::clamp(1 - static_cast<int>(std::floor(std::log10(uncertainty))), 0, 6)
             : 2;
}
// The en dash is the minus sign: it is as wide as a digit.
std::string with_dash(const std::string& number) {
  return number.starts_with('-') ? std::string(kDash) + number.substr(1) : number;
}
std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) {
    return std::string(kDash);
  }
  const std::string text = fmt::format("{:.{}f}", value, decimals);
  const bool is_zero = text.find_first_not_of("-0.") == std::string::npos;
  return is_zero && text.starts_with('-') ? text.substr(1) : with_dash(text);  // zero has no sign
}
std::string plus_minus(double value, int decimals) { return "\u00b1 " + fixed(value, decimals); }

std::string upper(std::string_view text) {
  std::string out;
  for (const char c : text) {
    out += c == '_' ? ' ' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return out;
}

std::string date_of(UtcTime time) { return to_iso8601(time).substr(0, 10); }
std::string or_not_stated(const std::string& text) { return text.empty() ? "not stated" : text; }

// A name that was only typed is no proof of who it was.
std::string operator_of(const Certificate& c) {
  return c.operator_name.empty() || c.operator_authenticated
             ? or_not_stated(c.operator_name)
             : c.operator_name + " (not authenticated)";
}

std::string_view meaning_of(JigVerdict verdict) {
  switch (verdict) {
    case JigVerdict::pass:
      return "Every quantity lies within its limits by the guard band or more.";
    case JigVerdict::conditional_pass:
      return "Every quantity lies within its limits, but not every one by the whole guard band, or "
             "the unit failed before.";
    case JigVerdict::conditional_fail:
      return "At least one quantity lies beyond its limit, by less than the guard band.";
    case JigVerdict::fail:
      return "At least one quantity lies beyond its limit by the guard band or more, readings "
             "contradict each other, or the unit did not take its constants.";
    case JigVerdict::inconclusive:
    case JigVerdict::stopped:
      break;
  }
  return "";
}

class Sheet : PageFlow {
 public:
  // `pages`: for "Page 1 of 2"; the sheet is drawn once to count them.
  Sheet(std::unique_ptr<PdfDocument> pdf, const Certificate& certificate, const QrCode& qr,
        std::size_t pages)
      : PageFlow(std::move(pdf),
                 fmt::format("Certificate {}  \u00b7  {}", certificate.run, certificate.serial),
                 "Not an accredited calibration", pages),
        certificate_(certificate) {
    head(qr);
    unit_and_calibration();
    verdict();
    results();
    found_and_left();
    conditions();
    quantities();
    poses();
    statements();
    signatures();
  }
  using PageFlow::bytes;
  using PageFlow::pages;

 private:
  const JudgedQuantity* quantity(std::string_view name) const {
    const auto& all = certificate_.quantities;
    const auto found = std::find_if(all.begin(), all.end(), [&](const JudgedQuantity& candidate) {
      return candidate.name == name;
    });
    return found == all.end() ? nullptr : &*found;
  }

  void head(const QrCode& qr) {
    pdf_->text(kLeft_mm, 26, "Calibration certificate", {PdfFont::bold, 18});
    pdf_->text(kLeft_mm, 32.5, "Accelerometer of an activity monitor, measured in six orientations",
               {PdfFont::regular, 9, kGrey});
    pdf_->text(kLeft_mm, 40, "Certificate", kLabel);
    pdf_->text(kLeft_mm + 20, 40, certificate_.run, kMono);
    const double module_mm = kQr_mm / static_cast<double>(qr.size);
    for (std::size_t row = 0; row < qr.size; ++row) {
      for (std::size_t column = 0; column < qr.size; ++column) {
        if (qr.at(row, column)) {
          // Slightly wider and higher, so that no viewer shows light lines between modules.
          pdf_->box(kRight_mm - kQr_mm + static_cast<double>(column) * module_mm,
                    kTop_mm + static_cast<double>(row) * module_mm, module_mm + 0.01,
                    module_mm + 0.01, 0);
        }
      }
    }
    rule(46.5, 0.5, 0);
    y_mm_ = 53;
  }

  void unit_and_calibration() {
    const Certificate& c = certificate_;
    const std::string due = c.jig_due
                                ? date_of(*c.jig_due) + (*c.jig_due < c.started ? " (overdue)" : "")
                                : "not stated";
    const std::string measured = fmt::format("{} to {} UTC", to_iso8601(c.started).substr(11, 8),
                                             to_iso8601(c.ended).substr(11, 8));
    grid({{{{"Serial number", c.serial, kStrong},
            {"Date of calibration", date_of(c.ended), kStrong}}},
          {{{"Model", or_not_stated(c.model)}, {"Date of issue", date_of(c.ended)}}},
          {{{"Firmware", or_not_stated(c.firmware)}, {"Measured", measured}}},
          {{{"Filter setting", c.filter}, {"Station", or_not_stated(c.station)}}},
          {{{"Jig", or_not_stated(c.jig)}, {"Operator", operator_of(c)}}},
          {{{"Jig calibrated until", due}, {"Software", or_not_stated(c.software)}}}});
  }

  void verdict() {
    y_mm_ += 2.5;
    const Row meaning = pdf_->lines(meaning_of(certificate_.verdict), kWidth_mm - 66, kBody);
    const double height_mm = std::max(12.0, 4.5 + kLine_mm * static_cast<double>(meaning.size()));
    pdf_->box(kLeft_mm, y_mm_ - 3, kWidth_mm, height_mm, 0.92);
    pdf_->box(kLeft_mm, y_mm_ - 3, 1.6, height_mm, is_passed(certificate_.verdict) ? 0.35 : 0);
    const bool passed = is_passed(certificate_.verdict);
    pdf_->text(kLeft_mm + 5, y_mm_ + (passed ? 2.6 : 4.4), upper(to_string(certificate_.verdict)),
               {PdfFont::bold, 12});
    if (passed) {
      pdf_->text(kLeft_mm + 5, y_mm_ + 7.2,
                 certificate_.written ? "WRITTEN INTO THE UNIT" : "NOT WRITTEN INTO THE UNIT",
                 {PdfFont::bold, 8});
    }
    double at_mm = y_mm_ + (meaning.size() == 1 ? 4.2 : 2);
    for (const std::string& line : meaning) {
      pdf_->text(kLeft_mm + 62, at_mm, line, kBody);
      at_mm += kLine_mm;
    }
    y_mm_ += height_mm + 0.6;
    for (const std::string& reason : certificate_.reasons) {
      y_mm_ += 1;
      paragraph("\u2022 " + reason, kReason);
    }
  }

  void results() {
    section("Results", 22);
    std::vector<Row> rows;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double lsb_per_g = 1 / certificate_.sensitivity_g_per_lsb[axis];
      const double u_lsb = lsb_per_g * certificate_.sensitivity_expanded_percent[axis] / 100;
      const double zero_lsb = certificate_.zero_lsb[axis];
      const double zero_mg = kMgPerG * zero_lsb * certificate_.sensitivity_g_per_lsb[axis];
      // In counts: in mg the scale's own uncertainty counts too, and stands beside the limits.
      const double zero_u_lsb = certificate_.zero_expanded_lsb()[axis];
      const int places = decimals_for(u_lsb);
      const int zero_places = decimals_for(zero_u_lsb);
      rows.push_back({std::string(1, "XYZ"[axis]), fixed(lsb_per_g, places),
                      plus_minus(u_lsb, places), fixed(zero_lsb, zero_places),
                      plus_minus(zero_u_lsb, zero_places), fixed(zero_mg, 1)});
    }
    table({{"Axis", 16, Align::left},
           {"Sensitivity, LSB/g", 34},
           {"expanded uncertainty", 34},
           {"Zero offset, LSB", 30},
           {"expanded uncertainty", 34},
           {"in mg", 22}},
          rows);
    const double k = certificate_.decision.coverage_factor;
    paragraph(
        fmt::format(
            "1 g is 9.80665 m/s\u00b2. Expanded uncertainty: standard uncertainty times the "
            "coverage factor k = {:g}, which for a normal distribution corresponds to a "
            "coverage probability of about {} %. It holds at the time and the temperature "
            "of the measurement and says nothing about long-term drift.",
            k,
            k == 2 ? std::string("95") : fmt::format("{:.1f}", 100 * std::erf(k / std::sqrt(2.0)))),
        kNote);
  }

  static Row constants_row(std::string name, const StoredConstants& stored,
                           const std::string& calibrated, std::optional<double> residual_mg) {
    Row row = {std::move(name)};
    for (const auto* three : {&stored.positive_lsb, &stored.negative_lsb, &stored.zero_lsb}) {
      for (const int value : *three) {
        row.push_back(fixed(value, 0));
      }
    }
    row.push_back(calibrated.empty() ? std::string(kDash) : calibrated.substr(0, 10));
    row.push_back(residual_mg ? fixed(*residual_mg, 1) : std::string(kDash));
    return row;
  }

  void found_and_left() {
    section("Constants of the unit, as found and as left", 30);
    const Certificate& c = certificate_;
    std::vector<Row> rows;
    if (c.as_found) {
      rows.push_back(constants_row("As found", c.as_found->stored, c.as_found->calibrated,
                                   c.as_found->residual_mg));
    }
    const JudgedQuantity* rounded = quantity("rounded_residual_mg");
    rows.push_back(
        constants_row("Measured", c.measured, "",
                      rounded != nullptr ? std::optional(rounded->value) : std::nullopt));
    if (c.as_left) {
      rows.push_back(constants_row("As left", c.as_left->stored, c.as_left->calibrated,
                                   c.as_left->residual_mg));
    }
    std::vector<Column> columns = {{"LSB", 20, Align::left}};
    for (const char* name : {"+1 g", "\u20131 g", "0 g"}) {
      for (const char* axis : {"X", "Y", "Z"}) {
        columns.push_back({fmt::format("{} {}", name, axis), 12.5});
      }
    }
    columns.push_back({"dated", 20});
    columns.push_back({"residual, mg", 17.5});
    table(columns, rows);
    paragraph(certificate_.written
                  ? "The measured constants were written into the unit, read back, and measured "
                    "again in two orientations with what the unit answered."
                  : "Nothing was written into the unit: as left is as found.",
              kNote);
  }

  void conditions() {
    section("Conditions and method", 30);
    const JudgedQuantity* mean = quantity("temperature_c");
    const JudgedQuantity* change = quantity("temperature_change_c");
    const double gravity_u =
        certificate_.decision.coverage_factor * certificate_.gravity_standard_uncertainty_m_per_s2;
    const int places = decimals_for(gravity_u);
    grid({{{{"Temperature", mean == nullptr
                                ? "not stated"
                                : fmt::format("{} \u00b0C \u00b1 {} \u00b0C", fixed(mean->value, 1),
                                              fixed(mean->expanded_uncertainty, 1))},
            {"Local gravity",
             fmt::format("{} m/s\u00b2 \u00b1 {} m/s\u00b2",
                         fixed(certificate_.gravity_m_per_s2, places), fixed(gravity_u, places))}}},
          {{{"Change", change == nullptr ? "not stated" : fixed(change->value, 1) + " \u00b0C"},
            {"Evaluation", or_not_stated(method_in_words(certificate_.method))}}}});
    y_mm_ += 0.8;
    paragraph(
        "The unit was held still on the jig with each of its axes up and down in turn, and the "
        "mean of its raw readings was taken in every orientation. Sensitivity and zero of each "
        "axis follow from them and from local gravity; orientations that were measured again and "
        "not used for the result verify it. The uncertainty comprises noise, the unit's seating on "
        "the jig, local gravity, and what the result leaves on the orientations that were not "
        "used. The reference is gravity itself; the jig's directions enter in second order only.");
  }

  static Row quantity_row(const JudgedQuantity& judged) {
    const QuantityInfo& info = *find_quantity(judged.name);
    const bool uncertain = judged.expanded_uncertainty > 0;
    const int places = uncertain ? std::min(decimals_for(judged.expanded_uncertainty), 3) : 2;
    const auto limit = [](const std::optional<double>& value) {
      return value ? with_dash(fmt::format("{:g}", *value)) : std::string(kDash);
    };
    return {std::string(info.title) + (judged.axis.empty() ? "" : ", " + upper(judged.axis)),
            std::string(info.unit),
            fixed(judged.value, places),
            uncertain ? plus_minus(judged.expanded_uncertainty, places) : std::string(kDash),
            limit(judged.low),
            limit(judged.high),
            upper(to_string(judged.verdict))};
  }

  void quantities() {
    section("Conformity with limits", 30);
    std::vector<Row> rows;
    for (const JudgedQuantity& judged : certificate_.quantities) {
      rows.push_back(quantity_row(judged));
    }
    table({{"Quantity", 60, Align::left},
           {"unit", 10, Align::left},
           {"value", 18},
           {"expanded uncertainty", 24},
           {"low", 14},
           {"high", 14},
           {"result", 30}},
          rows);
    const DecisionRule& rule = certificate_.decision;
    paragraph(
        fmt::format(
            "Decision rule: ILAC-G8:09/2019, 4.2.3, with a guard band of {:g} times the expanded "
            "uncertainty on both sides of each limit. Pass: inside the limits by the guard band or "
            "more. Conditional pass: inside, but nearer. Conditional fail: beyond by less than the "
            "guard band. Fail: beyond by more.{}",
            rule.guard_factor,
            rule.guard_factor == 1 && rule.coverage_factor == 2
                ? " The probability of a wrong pass is at most 2.5 %."
                : ""),
        kNote);
    paragraph(fmt::format("Limits: {}, SHA-256 {}.", certificate_.limits_source,
                          certificate_.limits_sha256),
              kNote);
  }

  void poses() {
    section("Readings", 30);
    std::vector<Row> rows;
    for (const auto* list : {&certificate_.poses, &certificate_.verification}) {
      for (const Certificate::Pose& pose : *list) {
        rows.push_back({pose.pose.empty() ? "" : with_dash(upper(pose.pose)) + " up",
                        list == &certificate_.poses ? "result"
                        : pose.chose_solution       ? "choice"
                                                    : "verification",
                        fixed(pose.mean_lsb[0], 2), fixed(pose.mean_lsb[1], 2),
                        fixed(pose.mean_lsb[2], 2), fmt::format("{}", pose.samples),
                        pose.temperature_c ? fixed(*pose.temperature_c, 1) : std::string(kDash),
                        fixed(pose.tilt_deg, 2),
                        pose.error_mg ? fixed(*pose.error_mg, 2) : std::string(kDash)});
      }
    }
    table({{"Orientation", 21, Align::left},
           {"used for", 23, Align::left},
           {"X, LSB", 19},
           {"Y, LSB", 19},
           {"Z, LSB", 19},
           {"samples", 16},
           {"\u00b0C", 14},
           {"tilt, \u00b0", 15},
           {"error, mg", 24}},
          rows);
    paragraph(
        fmt::format("All samples are kept; SHA-256 {}.", or_not_stated(certificate_.raw_sha256)),
        kNote);
    if (!certificate_.head.empty()) {
      paragraph(fmt::format("Head of the store's history at this run: {}.", certificate_.head),
                kNote);
    }
  }

  void statements() {
    section("Statements", 42);  // and the signatures, which do not stand alone
    paragraph(
        "This is not an accredited calibration. The station is not accredited to ISO/IEC 17025, "
        "and this certificate does not claim to be recognised under the ILAC MRA.");
    y_mm_ += 1;
    paragraph(
        "The results relate to the unit named above as it was measured. Reproduce this certificate "
        "in full only. It can be made again from the station's store, byte by byte, with its "
        "number; the QR code holds the unit's serial number and the certificate's number.");
  }

  void signatures() {
    need(20);
    y_mm_ += 13;
    constexpr double kHalf_mm = (kWidth_mm - 12) / 2;
    constexpr double kSecond_mm = kRight_mm - kHalf_mm;
    for (const double x_mm : {kLeft_mm, kSecond_mm}) {
      pdf_->line(x_mm, y_mm_, x_mm + kHalf_mm, y_mm_, 0.2, 0);
    }
    y_mm_ += 4;
    const std::string& name = certificate_.operator_name;
    text(kLeft_mm,
         cut(name.empty() ? "Measured by (name, date, signature)"
                          : fmt::format("Measured by {} (date, signature)", name),
             kHalf_mm, kNote),
         kNote);
    text(kSecond_mm, "Approved by (name, date, signature)", kNote);
  }

  const Certificate& certificate_;
};

Result<std::unique_ptr<PdfDocument>> empty_document(const Certificate& certificate) {
  return new_pdf_document(
      fmt::format("Calibration certificate {} of {}", certificate.run, certificate.serial),
      certificate.ended);
}

}  // namespace

Result<Bytes> certificate_pdf(const Certificate& certificate) {
  SIXPOINT_ASSIGN(const QrCode qr,
                  qr_code(fmt::format("sixpoint:{}:{}", certificate.serial, certificate.run)));
  SIXPOINT_ASSIGN(auto counted, empty_document(certificate));
  const std::size_t pages = Sheet(std::move(counted), certificate, qr, 0).pages();
  SIXPOINT_ASSIGN(auto pdf, empty_document(certificate));
  return Sheet(std::move(pdf), certificate, qr, pages).bytes();
}

}  // namespace sixpoint::station
