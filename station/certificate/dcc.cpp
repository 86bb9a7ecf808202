#include "station/certificate/dcc.h"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/measure.h"
#include "base/text/html.h"
#include "station/limits/limits.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kAcceleration = R"(\metre\second\tothe{-2})";
constexpr const char* kOne = R"(\one)";

// What XML can hold: UTF-8 without control characters; never empty, which the schema forbids.
std::string said(const std::string& content) {
  const std::string utf8 =
      Json::parse(Json(content).dump(-1, ' ', false, Json::error_handler_t::replace))
          .get<std::string>();
  return content.empty() ? "not stated" : html_escaped(printable(utf8, 4000));
}

// XML that is written from the outside in: <name> ... </name>.
class Xml {
 public:
  std::string text;

  template <class Inside>
  void element(const std::string& name, Inside inside, const std::string& ref_type = {}) {
    text += ref_type.empty() ? fmt::format("<{}>", name)
                             : fmt::format("<{} refType=\"{}\">", name, ref_type);
    inside();
    text += fmt::format("</{}>\n", name.substr(0, name.find(' ')));
  }
  void value(const std::string& name, const std::string& content) {
    text += fmt::format("<{0}>{1}</{0}>\n", name, said(content));
  }
  // A text in the one language of the document.
  void words(const std::string& name, const std::string& content) {
    element(name, [&] { text += "<dcc:content lang=\"en\">" + said(content) + "</dcc:content>"; });
  }
};

// How a quantity of ours is said in SI units: value * factor + offset.
struct SiUnit {
  const char* name;
  double factor = 1;
  double offset = 0;
};
SiUnit si_unit_of(const JudgedQuantity& quantity) {
  const QuantityInfo* const info = find_quantity(quantity.name);
  const std::string_view unit = info != nullptr ? info->unit : std::string_view();
  if (unit == "mg") {
    return {kAcceleration, kStandardGravity_m_per_s2 / kMgPerG};
  }
  if (unit == "%") {
    return {kOne, 0.01};
  }
  if (unit == "\u00b0C") {
    const bool is_difference = quantity.name.find("change") != std::string::npos;
    return {R"(\kelvin)", 1, is_difference ? 0 : 273.15};
  }
  if (unit == "\u00b0") {
    return {R"(\degree)"};
  }
  return {kOne};
}

std::string number(double value) { return fmt::format("{:.9g}", std::isfinite(value) ? value : 0); }

struct Uncertainty {
  double expanded = 0;
  double coverage_factor = 2;
};

void real(Xml& xml, double value, const std::string& unit,
          const std::optional<Uncertainty>& uncertainty = {}) {
  xml.element("si:real", [&] {
    xml.value("si:value", number(value));
    xml.value("si:unit", unit);
    if (uncertainty && uncertainty->coverage_factor >= 1) {
      xml.element("si:expandedUnc", [&] {
        xml.value("si:uncertainty", number(std::abs(uncertainty->expanded)));
        xml.value("si:coverageFactor", number(uncertainty->coverage_factor));
        // Of a normal distribution: k = 2 is 95.45 %.
        xml.value("si:coverageProbability",
                  fmt::format("{:.4f}", std::erf(uncertainty->coverage_factor / std::sqrt(2.0))));
      });
    }
  });
}

template <class Inside>
void result(Xml& xml, const std::string& name, Inside inside) {
  xml.element("dcc:result", [&] {
    xml.words("dcc:name", name);
    xml.element("dcc:data", inside);
  });
}

// Without an element where nothing is said for or against the unit.
std::string conformity_of(JigVerdict verdict) {
  switch (verdict) {
    case JigVerdict::pass:
      return "pass";
    case JigVerdict::conditional_pass:
      return "conditionalPass";
    case JigVerdict::conditional_fail:
      return "conditionalFail";
    case JigVerdict::fail:
      return "fail";
    default:
      return {};
  }
}

void conformity(Xml& xml, JigVerdict verdict, const std::string& declaration) {
  const std::string status = conformity_of(verdict);
  std::string words = declaration;
  if (status.empty()) {
    words += fmt::format("{}No statement of conformity: {}.", words.empty() ? "" : " ",
                         to_string(verdict));
  }
  if (!words.empty()) {
    xml.words("dcc:declaration", words);
  }
  if (!status.empty()) {
    xml.value("dcc:conformity", status);
  }
}

void contact(Xml& xml, const std::string& name) {
  xml.words("dcc:name", name);
  xml.element("dcc:location", [&] { xml.words("dcc:further", "not stated"); });
}

void identification(Xml& xml, const char* issuer, const std::string& value, const char* name) {
  xml.element("dcc:identification", [&] {
    xml.value("dcc:issuer", issuer);
    xml.value("dcc:value", value);
    xml.words("dcc:name", name);
  });
}

void administrative_data(Xml& xml, const Certificate& c) {
  const std::size_t blank = std::min(c.software.find(' '), c.software.size());
  xml.element("dcc:dccSoftware", [&] {
    xml.element("dcc:software", [&] {
      xml.words("dcc:name", c.software.substr(0, blank));
      xml.value("dcc:release", c.software.substr(std::min(blank + 1, c.software.size())));
    });
  });
  xml.element("dcc:coreData", [&] {
    xml.value("dcc:countryCodeISO3166_1", "ZZ");
    xml.value("dcc:usedLangCodeISO639_1", "en");
    xml.value("dcc:mandatoryLangCodeISO639_1", "en");
    xml.value("dcc:uniqueIdentifier", "sixpoint:" + c.serial + ":" + c.run);
    xml.value("dcc:beginPerformanceDate", to_iso8601(c.started).substr(0, 10));
    xml.value("dcc:endPerformanceDate", to_iso8601(c.ended).substr(0, 10));
    xml.value("dcc:performanceLocation", "laboratory");
    xml.value("dcc:issueDate", to_iso8601(c.ended).substr(0, 10));
  });
  xml.element("dcc:items", [&] {
    xml.element("dcc:item", [&] {
      xml.words("dcc:name", "Activity monitor");
      xml.element("dcc:manufacturer", [&] { xml.words("dcc:name", ""); });
      xml.value("dcc:model", c.model);
      xml.element("dcc:identifications",
                  [&] { identification(xml, "manufacturer", c.serial, "Serial number"); });
    });
  });
  xml.element("dcc:calibrationLaboratory",
              [&] { xml.element("dcc:contact", [&] { contact(xml, c.station); }); });
  xml.element("dcc:respPersons", [&] {
    xml.element("dcc:respPerson", [&] {
      xml.element("dcc:person", [&] { xml.words("dcc:name", c.operator_name); });
      if (!c.operator_authenticated) {
        xml.words("dcc:description", "The name was not authenticated.");
      }
      xml.value("dcc:role", "operator");
      xml.value("dcc:mainSigner", "true");
    });
  });
  xml.element("dcc:customer", [&] { contact(xml, ""); });
}

void statements(Xml& xml, const Certificate& c) {
  xml.element(
      "dcc:statement",
      [&] {
        xml.value("dcc:norm", "ILAC-G8:09/2019");
        xml.value("dcc:reference", "4.2.3");
        conformity(xml, c.verdict,
                   fmt::format("Decision rule: a quantity passes where it lies within its limits "
                               "by the guard band, which is {:.3g} times the expanded uncertainty "
                               "(k = {:.3g}) or the least guard band of the quantity. Limits: {}, "
                               "SHA-256 {}.",
                               c.decision.guard_factor, c.decision.coverage_factor, c.limits_source,
                               c.limits_sha256));
      },
      "basic_conformity");
  xml.element("dcc:statement", [&] {
    xml.words(
        "dcc:declaration",
        std::string("This is not an accredited calibration. The constants were ") +
            (c.written ? "written into the unit and read back." : "not written into the unit."));
  });
  std::vector<std::string> remarks = c.reasons;
  if (c.jig_due) {
    remarks.push_back("the jig's calibration is due on " + to_iso8601(*c.jig_due).substr(0, 10));
  }
  if (!remarks.empty()) {
    xml.element("dcc:statement", [&] {
      xml.words("dcc:declaration", fmt::format("Remarks: {}.", fmt::join(remarks, "; ")));
    });
  }
}

void judged(Xml& xml, const JudgedQuantity& quantity, const Certificate& c) {
  const QuantityInfo* const info = find_quantity(quantity.name);
  const std::string name =
      fmt::format("{}{}{}", info != nullptr ? info->title : std::string_view(quantity.name),
                  quantity.axis.empty() ? "" : ", axis ", quantity.axis);
  const SiUnit unit = si_unit_of(quantity);
  const auto in_si = [&](double value) { return value * unit.factor + unit.offset; };
  result(xml, name, [&] {
    xml.element(
        "dcc:quantity",
        [&] {
          real(
              xml, in_si(quantity.value), unit.name,
              Uncertainty{quantity.expanded_uncertainty * unit.factor, c.decision.coverage_factor});
          xml.element("dcc:measurementMetaData", [&] {
            xml.element(
                "dcc:metaData",
                [&] {
                  conformity(xml, quantity.verdict, {});
                  if (quantity.low || quantity.high) {
                    xml.element("dcc:data", [&] {
                      const auto limit = [&](const std::optional<double>& at, const char* kind) {
                        if (at) {
                          xml.element(
                              "dcc:quantity", [&] { real(xml, in_si(*at), unit.name); }, kind);
                        }
                      };
                      limit(quantity.low, "basic_acceptanceLimitLower");
                      limit(quantity.high, "basic_acceptanceLimitUpper");
                    });
                  }
                },
                "basic_conformity");
          });
        },
        "basic_measuredValue");
  });
}

void results(Xml& xml, const Certificate& c) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double g_per_lsb = c.sensitivity_g_per_lsb[axis];
    const double per_count = g_per_lsb * kStandardGravity_m_per_s2;
    result(xml, fmt::format("Acceleration of one count, axis {}", kAxisNames[axis]), [&] {
      xml.element("dcc:quantity", [&] {
        real(xml, per_count, kAcceleration,
             Uncertainty{per_count * c.sensitivity_expanded_percent[axis] / 100,
                         c.decision.coverage_factor});
      });
    });
    result(xml, fmt::format("Reading without acceleration, counts, axis {}", kAxisNames[axis]),
           [&] {
             xml.element("dcc:quantity", [&] {
               real(xml, c.zero_lsb[axis], kOne,
                    Uncertainty{c.zero_expanded_lsb()[axis], c.decision.coverage_factor});
             });
           });
  }
  result(xml, "Local gravity", [&] {
    xml.element("dcc:quantity", [&] {
      real(xml, c.gravity_m_per_s2, kAcceleration,
           Uncertainty{c.decision.coverage_factor * c.gravity_standard_uncertainty_m_per_s2,
                       c.decision.coverage_factor});
    });
  });
  for (const JudgedQuantity& quantity : c.quantities) {
    judged(xml, quantity, c);
  }
}

}  // namespace

std::string certificate_dcc(const Certificate& certificate) {
  Xml xml;
  xml.text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  xml.element(
      "dcc:digitalCalibrationCertificate xmlns:dcc=\"https://ptb.de/dcc\" "
      "xmlns:si=\"https://ptb.de/si\" schemaVersion=\"3.2.0\"",
      [&] {
        xml.element("dcc:administrativeData", [&] {
          administrative_data(xml, certificate);
          xml.element("dcc:statements", [&] { statements(xml, certificate); });
        });
        xml.element("dcc:measurementResults", [&] {
          xml.element("dcc:measurementResult", [&] {
            xml.words("dcc:name", "Six-position calibration");
            xml.element("dcc:usedMethods", [&] {
              xml.element("dcc:usedMethod",
                          [&] { xml.words("dcc:name", method_in_words(certificate.method)); });
            });
            xml.element("dcc:measuringEquipments", [&] {
              xml.element("dcc:measuringEquipment", [&] {
                xml.words("dcc:name", "Six-position jig");
                xml.element("dcc:identifications", [&] {
                  identification(xml, "calibrationLaboratory", certificate.jig, "Jig");
                });
              });
            });
            xml.element("dcc:results", [&] { results(xml, certificate); });
          });
        });
      });
  return xml.text;
}

}  // namespace sixpoint::station
