// The certificate as a document of A4 pages.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "station/certificate.h"
#include "station/pdf_document.h"
#include "station/qr_code.h"

namespace sixpoint::station {

namespace {

constexpr double kLeft_mm = 20;
constexpr double kRight_mm = 190;
constexpr double kTop_mm = 18;
constexpr double kBottom_mm = 272;  // the footer stands below
constexpr double kText_pt = 9;
constexpr double kSmall_pt = 7.5;
constexpr double kLine_mm = 4.6;
constexpr double kRow_mm = 4.25;  // of a table
constexpr double kGrey = 0.4;
constexpr std::string_view kDash = "\u2013";

enum class Align { left, right, centre };

// Value and uncertainty to the uncertainty's second digit (GUM 7.2.6).
int decimals_for(double uncertainty) {
  return uncertainty > 0 && std::isfinite(uncertainty)
             ? std::clamp(1 - static_cast<int>(std::floor(std::log10(uncertainty))), 0, 6)
             : 2;
}
std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) {
    return std::string(kDash);
  }
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.front() == '-') {
    // Zero has no sign. The standard fonts have no minus; the en dash is as wide as their digits.
    const bool is_zero = text.find_first_not_of("-0.") == std::string::npos;
    text = (is_zero ? std::string() : std::string(kDash)) + text.substr(1);
  }
  return text;
}

std::string date_of(UtcTime time) { return to_iso8601(time).substr(0, 10); }
std::string or_not_stated(const std::string& text) { return text.empty() ? "not stated" : text; }

std::string_view title_of(JigVerdict verdict) {
  switch (verdict) {
    case JigVerdict::pass:
      return "PASS";
    case JigVerdict::conditional_pass:
      return "CONDITIONAL PASS";
    case JigVerdict::conditional_fail:
      return "CONDITIONAL FAIL";
    case JigVerdict::fail:
      return "FAIL";
    case JigVerdict::inconclusive:
      return "INCONCLUSIVE";
    case JigVerdict::stopped:
      return "STOPPED";
  }
  return "";
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
      return "At least one quantity lies beyond its limit by the guard band or more, or readings "
             "contradict each other.";
    case JigVerdict::inconclusive:
    case JigVerdict::stopped:
      break;
  }
  return "";
}

struct Column {
  std::string head;
  double width_mm = 0;
  Align align = Align::left;
};

class Sheet {
 public:
  Sheet(const Certificate& certificate, const QrCode& qr)
      : certificate_(certificate),
        pdf_(fmt::format("Calibration certificate {} of {}", certificate.run, certificate.serial),
             certificate.ended) {
    pdf_.add_page();
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
    footers();
  }
  Result<Bytes> bytes() { return pdf_.bytes(); }

 private:
  double width(std::string_view text, PdfFont font, double size_pt) const {
    return pdf_.width_mm(text, font, size_pt);
  }

  // As many lines as it takes; a word that is wider than a line is cut where it must be.
  std::vector<std::string> wrap(std::string_view text, double room_mm, PdfFont font,
                                double size_pt) const {
    std::vector<std::string> lines(1);
    while (!text.empty()) {
      const std::size_t end = std::min(text.find(' '), text.size());
      std::string word(text.substr(0, end));
      text.remove_prefix(std::min(text.size(), end + 1));
      std::string& last = lines.back();
      const std::string joined = last.empty() ? word : last + " " + word;
      if (width(joined, font, size_pt) <= room_mm) {
        last = joined;
        continue;
      }
      if (!last.empty()) {
        lines.emplace_back();
      }
      while (width(word, font, size_pt) > room_mm) {
        std::size_t fits = 1;
        while (fits < word.size() && width(word.substr(0, fits + 1), font, size_pt) <= room_mm) {
          ++fits;
        }
        // Not through the middle of a character.
        while (fits > 1 && (static_cast<unsigned char>(word[fits]) & 0xC0U) == 0x80) {
          --fits;
        }
        lines.back() = word.substr(0, fits);
        lines.emplace_back();
        word.erase(0, fits);
      }
      lines.back() = word;
    }
    return lines;
  }

  void put(double x_mm, double room_mm, Align align, std::string_view text, PdfFont font,
           double size_pt, double grey = 0) {
    const double slack = room_mm - width(text, font, size_pt);
    const double shift = align == Align::left ? 0 : align == Align::right ? slack : slack / 2;
    pdf_.text(x_mm + shift, y_mm_, text, font, size_pt, grey);
  }

  void need(double height_mm) {
    if (y_mm_ + height_mm > kBottom_mm) {
      pdf_.add_page();
      y_mm_ = kTop_mm;
    }
  }

  void section(std::string_view title, double least_mm) {
    y_mm_ += 3.4;
    need(least_mm + 8);
    pdf_.text(kLeft_mm, y_mm_ + 3.4, title, PdfFont::bold, 10.5);
    pdf_.line(kLeft_mm, y_mm_ + 5, kRight_mm, y_mm_ + 5, 0.25, 0.6);
    y_mm_ += 9.4;
  }

  void paragraph(std::string_view text, double size_pt = kText_pt, double grey = 0) {
    const double step_mm = size_pt * 0.46;
    for (const std::string& line : wrap(text, kRight_mm - kLeft_mm, PdfFont::regular, size_pt)) {
      need(step_mm);
      pdf_.text(kLeft_mm, y_mm_, line, PdfFont::regular, size_pt, grey);
      y_mm_ += step_mm;
    }
  }

  struct Entry {
    std::string key;
    std::string value;
    PdfFont font = PdfFont::regular;
  };

  // Two columns of names and values, row by row, so that both stay level however long one gets.
  void grid(const std::vector<Entry>& left, const std::vector<Entry>& right) {
    constexpr double kKey_mm = 31;
    constexpr double kGap_mm = 5;
    const double half_mm = (kRight_mm - kLeft_mm - kGap_mm) / 2;
    for (std::size_t row = 0; row < std::max(left.size(), right.size()); ++row) {
      std::size_t lines = 1;
      std::vector<std::pair<const Entry*, std::vector<std::string>>> cells;
      for (const auto* side : {&left, &right}) {
        if (row < side->size()) {
          const Entry& entry = (*side)[row];
          cells.emplace_back(&entry, wrap(entry.value, half_mm - kKey_mm, entry.font, kText_pt));
          lines = std::max(lines, cells.back().second.size());
        } else {
          cells.emplace_back(nullptr, std::vector<std::string>());
        }
      }
      need(kLine_mm * static_cast<double>(lines));
      const double top_mm = y_mm_;
      for (std::size_t side = 0; side < cells.size(); ++side) {
        const auto& [entry, texts] = cells[side];
        const double x_mm = kLeft_mm + static_cast<double>(side) * (half_mm + kGap_mm);
        y_mm_ = top_mm;
        if (entry != nullptr) {
          pdf_.text(x_mm, y_mm_, entry->key, PdfFont::regular, kText_pt, kGrey);
        }
        for (const std::string& text : texts) {
          pdf_.text(x_mm + kKey_mm, y_mm_, text, entry->font, kText_pt);
          y_mm_ += kLine_mm;
        }
      }
      y_mm_ = top_mm + kLine_mm * static_cast<double>(lines) + 0.3;
    }
  }

  void table_head(const std::vector<Column>& columns) {
    std::size_t lines = 1;
    std::vector<std::vector<std::string>> heads;
    for (const Column& column : columns) {
      heads.push_back(wrap(column.head, column.width_mm - 1.5, PdfFont::bold, kSmall_pt));
      lines = std::max(lines, heads.back().size());
    }
    const double bottom_mm = y_mm_ + 3.4 * static_cast<double>(lines - 1);
    double x_mm = kLeft_mm;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      y_mm_ = bottom_mm - 3.4 * static_cast<double>(heads[i].size() - 1);
      for (const std::string& text : heads[i]) {
        put(x_mm + 0.75, columns[i].width_mm - 1.5, columns[i].align, text, PdfFont::bold,
            kSmall_pt);
        y_mm_ += 3.4;
      }
      x_mm += columns[i].width_mm;
    }
    y_mm_ = bottom_mm + 1.4;
    pdf_.line(kLeft_mm, y_mm_, x_mm, y_mm_, 0.25, 0.3);
    y_mm_ += 4;
  }

  void table(const std::vector<Column>& columns,
             const std::vector<std::vector<std::string>>& rows) {
    table_head(columns);
    for (std::size_t row = 0; row < rows.size(); ++row) {
      if (y_mm_ + kRow_mm > kBottom_mm) {
        pdf_.add_page();
        y_mm_ = kTop_mm;
        table_head(columns);
      }
      double x_mm = kLeft_mm;
      for (std::size_t i = 0; i < columns.size(); ++i) {
        put(x_mm + 0.75, columns[i].width_mm - 1.5, columns[i].align, rows[row][i],
            PdfFont::regular, 8.5);
        x_mm += columns[i].width_mm;
      }
      pdf_.line(kLeft_mm, y_mm_ + 1.3, x_mm, y_mm_ + 1.3, 0.1, 0.8);
      y_mm_ += kRow_mm;
    }
    y_mm_ += 0.6;
  }

  void head(const QrCode& qr) {
    pdf_.text(kLeft_mm, 26, "Calibration certificate", PdfFont::bold, 20);
    pdf_.text(kLeft_mm, 32.5, "Accelerometer of an activity monitor, measured in six orientations",
              PdfFont::regular, 10, kGrey);
    pdf_.text(kLeft_mm, 40, "Certificate", PdfFont::regular, kText_pt, kGrey);
    pdf_.text(kLeft_mm + 20, 40, certificate_.run, PdfFont::mono, kText_pt);
    constexpr double kQr_mm = 25;
    const double module_mm = kQr_mm / static_cast<double>(qr.size);
    for (std::size_t row = 0; row < qr.size; ++row) {
      for (std::size_t column = 0; column < qr.size;) {
        std::size_t end = column;
        while (end < qr.size && qr.at(row, end)) {
          ++end;
        }
        if (end > column) {
          // A hair wider and higher, so that no viewer leaves light seams.
          pdf_.box(kRight_mm - kQr_mm + static_cast<double>(column) * module_mm,
                   kTop_mm + static_cast<double>(row) * module_mm,
                   static_cast<double>(end - column) * module_mm + 0.01, module_mm + 0.01, 0);
        }
        column = std::max(end, column + 1);
      }
    }
    pdf_.line(kLeft_mm, 46.5, kRight_mm, 46.5, 0.5);
    y_mm_ = 53;
  }

  void unit_and_calibration() {
    const Certificate& c = certificate_;
    std::vector<Entry> unit = {
        {"Serial number", c.serial, PdfFont::bold},
        {"Model", or_not_stated(c.model)},
        {"Firmware", or_not_stated(c.firmware)},
        {"Filter setting", c.filter},
        {"Jig", or_not_stated(c.jig)},
        {"Jig calibrated until",
         c.jig_due ? date_of(*c.jig_due) + (*c.jig_due < c.started ? " (overdue)" : "")
                   : "not stated"}};
    grid(unit, {{"Date of calibration", date_of(c.ended), PdfFont::bold},
                {"Date of issue", date_of(c.ended)},
                {"Measured", fmt::format("{} to {} UTC", to_iso8601(c.started).substr(11, 8),
                                         to_iso8601(c.ended).substr(11, 8))},
                {"Station", or_not_stated(c.station)},
                {"Operator", or_not_stated(c.operator_name)},
                {"Software", or_not_stated(c.software)}});
  }

  void verdict() {
    y_mm_ += 2.5;
    const auto lines = wrap(meaning_of(certificate_.verdict), kRight_mm - kLeft_mm - 66,
                            PdfFont::regular, kText_pt);
    const double height_mm = std::max(12.0, 4.5 + kLine_mm * static_cast<double>(lines.size()));
    pdf_.box(kLeft_mm, y_mm_ - 3, kRight_mm - kLeft_mm, height_mm, 0.92);
    pdf_.box(kLeft_mm, y_mm_ - 3, 1.6, height_mm, is_passed(certificate_.verdict) ? 0.35 : 0);
    pdf_.text(kLeft_mm + 5, y_mm_ + 4.4, title_of(certificate_.verdict), PdfFont::bold, 13);
    double at_mm = y_mm_ + (lines.size() == 1 ? 4.2 : 2);
    for (const std::string& line : lines) {
      pdf_.text(kLeft_mm + 62, at_mm, line, PdfFont::regular, kText_pt);
      at_mm += kLine_mm;
    }
    y_mm_ += height_mm - 1;
    for (const std::string& reason : certificate_.reasons) {
      y_mm_ += 1;
      paragraph("\u2022 " + reason, kSmall_pt + 0.5);
    }
  }

  void results() {
    section("Results", 22);
    std::vector<std::vector<std::string>> rows;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double lsb_per_g = 1 / certificate_.sensitivity_g_per_lsb[axis];
      const double u_lsb = lsb_per_g * certificate_.sensitivity_expanded_percent[axis] / 100;
      const double zero_mg =
          kMgPerG * certificate_.zero_lsb[axis] * certificate_.sensitivity_g_per_lsb[axis];
      const double u_mg = certificate_.zero_expanded_mg[axis];
      const int places = decimals_for(u_lsb);
      const int zero_places = decimals_for(u_mg);
      rows.push_back(
          {std::string(1, "XYZ"[axis]), fixed(lsb_per_g, places), "\u00b1 " + fixed(u_lsb, places),
           fixed(zero_mg, zero_places), "\u00b1 " + fixed(u_mg, zero_places),
           fixed(certificate_.zero_lsb[axis], decimals_for(u_mg * lsb_per_g / kMgPerG))});
    }
    table({{"Axis", 16, Align::left},
           {"Sensitivity, LSB/g", 34, Align::right},
           {"expanded uncertainty", 34, Align::right},
           {"Zero offset, mg", 30, Align::right},
           {"expanded uncertainty", 34, Align::right},
           {"Zero, LSB", 22, Align::right}},
          rows);
    paragraph(fmt::format(
                  "1 g is 9.80665 m/s\u00b2. Expanded uncertainty: standard uncertainty times the "
                  "coverage factor k = {:g}, which for a normal distribution corresponds to a "
                  "coverage probability of about {} %. It holds at the time and the temperature "
                  "of the measurement and says nothing about long-term drift.",
                  certificate_.decision.coverage_factor,
                  certificate_.decision.coverage_factor == 2
                      ? std::string("95")
                      : fmt::format("{:.1f}", 100 * std::erf(certificate_.decision.coverage_factor /
                                                             std::sqrt(2.0)))),
              kSmall_pt, kGrey);
  }

  void found_and_left() {
    section("Constants of the unit, as found and as left", 30);
    const auto row = [](std::string name, const StoredConstants& stored,
                        const std::string& calibrated, std::optional<double> residual_mg) {
      std::vector<std::string> cells = {std::move(name)};
      for (const auto* three : {&stored.positive_lsb, &stored.negative_lsb, &stored.zero_lsb}) {
        for (const int value : *three) {
          cells.push_back(fixed(value, 0));
        }
      }
      cells.push_back(calibrated.empty() ? std::string(kDash) : calibrated.substr(0, 10));
      cells.push_back(residual_mg ? fixed(*residual_mg, 1) : std::string(kDash));
      return cells;
    };
    std::vector<std::vector<std::string>> rows;
    if (certificate_.as_found) {
      rows.push_back(row("As found", certificate_.as_found->stored,
                         certificate_.as_found->calibrated, certificate_.as_found->residual_mg));
    }
    std::optional<double> rounded_mg;
    for (const JudgedQuantity& quantity : certificate_.quantities) {
      if (quantity.name == "rounded_residual_mg") {
        rounded_mg = quantity.value;
      }
    }
    rows.push_back(row("Measured", certificate_.measured, "", rounded_mg));
    if (certificate_.as_left) {
      rows.push_back(row("As left", certificate_.as_left->stored, certificate_.as_left->calibrated,
                         certificate_.as_left->residual_mg));
    }
    std::vector<Column> columns = {{"LSB", 20, Align::left}};
    for (const char* name : {"+1 g", "\u20131 g", "0 g"}) {
      for (const char* axis : {"X", "Y", "Z"}) {
        columns.push_back({fmt::format("{} {}", name, axis), 12.5, Align::right});
      }
    }
    columns.push_back({"dated", 20, Align::right});
    columns.push_back({"residual, mg", 17.5, Align::right});
    table(columns, rows);
    paragraph(certificate_.written
                  ? "The measured constants were written into the unit, read back, and measured "
                    "again in two orientations with what the unit answered."
                  : "Nothing was written into the unit: as left is as found.",
              kSmall_pt, kGrey);
  }

  void conditions() {
    section("Conditions and method", 30);
    std::string temperature = "not stated";
    std::string change;
    for (const JudgedQuantity& quantity : certificate_.quantities) {
      if (quantity.name == "temperature_c") {
        temperature = fmt::format("{} \u00b0C \u00b1 {} \u00b0C", fixed(quantity.value, 1),
                                  fixed(quantity.expanded_uncertainty, 1));
      } else if (quantity.name == "temperature_change_c") {
        change = fmt::format("{} \u00b0C", fixed(quantity.value, 1));
      }
    }
    const double gravity_u =
        certificate_.decision.coverage_factor * certificate_.gravity_standard_uncertainty_m_per_s2;
    const int places = decimals_for(gravity_u);
    grid({{"Temperature", temperature}, {"Change", or_not_stated(change)}},
         {{"Local gravity",
           fmt::format("{} m/s\u00b2 \u00b1 {} m/s\u00b2",
                       fixed(certificate_.gravity_m_per_s2, places), fixed(gravity_u, places))},
          {"Evaluation", or_not_stated(certificate_.method)}});
    y_mm_ += 0.8;
    paragraph(
        "The unit was held still on the jig with each of its axes up and down in turn, and the "
        "mean "
        "of its raw readings was taken in every orientation. Sensitivity and zero of each axis "
        "follow from them and from local gravity; orientations that were measured again and not "
        "used for the result verify it. The uncertainty comprises noise, the unit's seating on the "
        "jig, local gravity, and what the result leaves on the orientations that were not used. "
        "The "
        "reference is gravity itself; the jig's directions enter in second order only.");
  }

  void quantities() {
    section("Conformity with limits", 30);
    std::vector<std::vector<std::string>> rows;
    for (const JudgedQuantity& quantity : certificate_.quantities) {
      const QuantityInfo& info = *find_quantity(quantity.name);
      const int places = quantity.expanded_uncertainty > 0
                             ? std::min(decimals_for(quantity.expanded_uncertainty), 3)
                             : 2;
      std::string name(info.title);
      if (!quantity.axis.empty()) {
        name += ", ";
        for (const char c : quantity.axis) {
          name += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
        }
      }
      const auto limit = [](const std::optional<double>& value) {
        return value ? fmt::format("{:g}", *value) : std::string(kDash);
      };
      std::string low = limit(quantity.low);
      if (low.front() == '-') {
        low = std::string(kDash) + low.substr(1);
      }
      rows.push_back({std::move(name), std::string(info.unit), fixed(quantity.value, places),
                      quantity.expanded_uncertainty > 0
                          ? "\u00b1 " + fixed(quantity.expanded_uncertainty, places)
                          : std::string(kDash),
                      low, limit(quantity.high), std::string(title_of(quantity.verdict))});
    }
    table({{"Quantity", 66, Align::left},
           {"unit", 10, Align::left},
           {"value", 20, Align::right},
           {"expanded uncertainty", 23, Align::right},
           {"low", 14, Align::right},
           {"high", 14, Align::right},
           {"result", 23, Align::right}},
          rows);
    paragraph(
        fmt::format(
            "Decision rule: ILAC-G8:09/2019, 4.2.3, with a guard band of {:g} times the expanded "
            "uncertainty on both sides of each limit. Pass: inside the limits by the guard band or "
            "more. Conditional pass: inside, but nearer. Conditional fail: beyond by less than the "
            "guard band. Fail: beyond by more.{}",
            certificate_.decision.guard_factor,
            certificate_.decision.guard_factor == 1 && certificate_.decision.coverage_factor == 2
                ? " The probability of a wrong pass is at most 2.5 %."
                : ""),
        kSmall_pt, kGrey);
    paragraph(fmt::format("Limits: {}, SHA-256 {}.", certificate_.limits_source,
                          certificate_.limits_sha256),
              kSmall_pt, kGrey);
  }

  void poses() {
    section("Readings", 30);
    std::vector<std::vector<std::string>> rows;
    for (const auto* list : {&certificate_.poses, &certificate_.verification}) {
      for (const Certificate::Pose& pose : *list) {
        std::string name = pose.pose;
        if (!name.empty()) {
          name = (name.front() == '-' ? std::string(kDash) : name.substr(0, 1)) +
                 static_cast<char>(std::toupper(static_cast<unsigned char>(name.back()))) + " up";
        }
        rows.push_back({name, list == &certificate_.poses ? "result" : "verification",
                        fixed(pose.mean_lsb[0], 2), fixed(pose.mean_lsb[1], 2),
                        fixed(pose.mean_lsb[2], 2), fmt::format("{}", pose.samples),
                        fixed(pose.temperature_c, 1), fixed(pose.tilt_deg, 2),
                        pose.error_mg ? fixed(*pose.error_mg, 2) : std::string(kDash)});
      }
    }
    table({{"Orientation", 21, Align::left},
           {"used for", 23, Align::left},
           {"X, LSB", 19, Align::right},
           {"Y, LSB", 19, Align::right},
           {"Z, LSB", 19, Align::right},
           {"samples", 16, Align::right},
           {"\u00b0C", 14, Align::right},
           {"tilt, \u00b0", 15, Align::right},
           {"error, mg", 24, Align::right}},
          rows);
    paragraph(fmt::format("All samples are kept; SHA-256 {}.", certificate_.raw_sha256.empty()
                                                                   ? std::string("not stated")
                                                                   : certificate_.raw_sha256),
              kSmall_pt, kGrey);
  }

  void statements() {
    section("Statements", 46);  // and the signatures, which do not stand alone
    paragraph(
        "This is not an accredited calibration. The station is not accredited to ISO/IEC 17025, "
        "and "
        "this certificate does not claim to be recognised under the ILAC MRA.");
    y_mm_ += 1;
    paragraph(
        "The results relate to the unit named above as it was measured. Reproduce this certificate "
        "in full only. It can be made again from the station's store, byte by byte, with its "
        "number; the QR code holds the unit's serial number and the certificate's number.");
  }

  void signatures() {
    need(20);
    y_mm_ += 13;
    const double half_mm = (kRight_mm - kLeft_mm - 12) / 2;
    for (const double x_mm : {kLeft_mm, kLeft_mm + half_mm + 12}) {
      pdf_.line(x_mm, y_mm_, x_mm + half_mm, y_mm_, 0.2);
    }
    y_mm_ += 4;
    const std::string by =
        wrap(certificate_.operator_name.empty()
                 ? "Measured by (name, date, signature)"
                 : fmt::format("Measured by {} (date, signature)", certificate_.operator_name),
             half_mm, PdfFont::regular, kSmall_pt)
            .front();
    pdf_.text(kLeft_mm, y_mm_, by, PdfFont::regular, kSmall_pt, kGrey);
    pdf_.text(kLeft_mm + half_mm + 12, y_mm_, "Approved by (name, date, signature)",
              PdfFont::regular, kSmall_pt, kGrey);
  }

  void footers() {
    for (std::size_t page = 0; page < pdf_.pages(); ++page) {
      pdf_.go_to(page);
      pdf_.line(kLeft_mm, 279, kRight_mm, 279, 0.2, 0.6);
      y_mm_ = 283.5;
      const auto serial =
          wrap(fmt::format("Certificate {}  \u00b7  {}", certificate_.run, certificate_.serial),
               140, PdfFont::regular, kSmall_pt);
      pdf_.text(kLeft_mm, y_mm_, serial.front(), PdfFont::regular, kSmall_pt, kGrey);
      put(kLeft_mm, kRight_mm - kLeft_mm, Align::right,
          fmt::format("Page {} of {}", page + 1, pdf_.pages()), PdfFont::regular, kSmall_pt, kGrey);
      y_mm_ += 4;
      pdf_.text(kLeft_mm, y_mm_, "Not an accredited calibration", PdfFont::regular, kSmall_pt,
                kGrey);
    }
  }

  const Certificate& certificate_;
  PdfDocument pdf_;
  double y_mm_ = kTop_mm;
};

}  // namespace

Result<Bytes> certificate_pdf(const Certificate& certificate) {
  SIXPOINT_ASSIGN(const QrCode qr,
                  qr_code(fmt::format("sixpoint:{}:{}", certificate.serial, certificate.run)));
  return Sheet(certificate, qr).bytes();
}

}  // namespace sixpoint::station
