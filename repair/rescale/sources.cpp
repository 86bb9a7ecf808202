#include "repair/rescale/sources.h"

#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "calib/application/agreement.h"
#include "calib/application/map_to_apply.h"
#include "db/records.h"
#include "gt3x/forms/model.h"

namespace sixpoint::repair {
namespace {

// In the order of SourceKind.
constexpr std::array<std::string_view, 5> kSourceNames = {"constants", "calibration_file", "scan",
                                                          "store", "unit_files"};

}  // namespace

std::string_view to_string(SourceKind kind) { return kSourceNames[static_cast<std::size_t>(kind)]; }

bool is_of_still_periods(std::string_view kind) {
  return kind == to_string(SourceKind::scan) || kind == to_string(SourceKind::unit_files);
}

std::vector<SourceKind> sources_in_order(const NamedSources& named) {
  std::vector<SourceKind> order;
  if (named.constants) {
    order = {SourceKind::constants};
  } else if (named.calibration_file) {
    order = {SourceKind::calibration_file};
  } else if (named.store && !named.scan) {
    order = {SourceKind::store};
  } else if (named.default_store && !named.scan) {
    order = {SourceKind::store, SourceKind::scan};
  } else {  // --scan, or nothing at all
    order = {SourceKind::scan};
  }
  if (named.or_scan && order.back() != SourceKind::scan) {
    order.push_back(SourceKind::scan);
  }
  if (named.unit_files && order.back() == SourceKind::scan) {
    order.push_back(SourceKind::unit_files);
  }
  return order;
}

std::optional<std::string> why_unfit(const calib::ConstantsRecord& record, const FileFacts& file,
                                     bool allow_prior) {
  if (gt3x::unit_serial(record.serial) != gt3x::unit_serial(file.serial)) {
    return fmt::format("the constants belong to unit {}, not to this one",
                       printable(record.serial, 60));
  }
  if (record.filter != calib::FilterConfiguration::current) {
    return "the constants were measured under the legacy filter configuration; this file was "
           "recorded under the current one: measure the unit under 'current'";
  }
  if (record.from_prior && !allow_prior) {
    return "the constants rest on a population prior, not on this unit's data; --allow-prior uses "
           "them all the same";
  }
  std::string impossible = calib::why_no_sensor(record.calibration);
  if (impossible.empty() && record.cross_axis) {
    impossible = calib::why_no_sensor(record.cross_axis->calibration);
  }
  if (!impossible.empty()) {
    return impossible + ": look for a mistake in the constants, or measure the unit anew";
  }
  return std::nullopt;
}

std::string digest_of(const calib::ConstantsRecord& record) {
  nlohmann::ordered_json content = {{"serial", record.serial},
                                    {"filter", calib::to_string(record.filter)},
                                    {"constants", calib::to_json(record.calibration)}};
  if (record.cross_axis) {
    content["cross_axis"] = calib::to_json(*record.cross_axis);
  }
  return text_sha256(content.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace))
      .substr(0, 32);
}

SourceUsed source_used(const std::string& kind, const std::string& id,
                       const calib::ConstantsRecord& record) {
  SourceUsed used{kind, id.empty() ? digest_of(record) : id, std::nullopt, std::nullopt,
                  record.from_prior};
  if (record.made_at != UtcTime{}) {
    used.made_at = record.made_at;
  }
  const bool has_terms = calib::map_to_apply(record).cross_axis;
  const calib::ConstantsUncertainty& applied =
      has_terms ? record.cross_axis->uncertainty : record.uncertainty;
  if (const double largest_mg = calib::largest_uncertainty_mg(applied); largest_mg > 0) {
    used.standard_uncertainty_mg = largest_mg;
  }
  return used;
}

std::string SourceUsed::brief() const {
  constexpr std::size_t kDate = 10;
  return fmt::format("{} {} ({}, {})", kind, db::shown_id(id),
                     made_at ? to_iso8601(*made_at).substr(0, kDate) : "no date",
                     standard_uncertainty_mg ? fmt::format("+- {:.1f} mg", *standard_uncertainty_mg)
                                             : "no uncertainty stated");
}

nlohmann::ordered_json SourceUsed::to_json() const {
  nlohmann::ordered_json json = {{"kind", kind}, {"id", id}, {"made_at", nullptr}};
  if (made_at) {
    json["made_at"] = to_iso8601(*made_at);
  }
  json["standard_uncertainty_mg"] = calib::number_or_null(standard_uncertainty_mg);
  json["from_prior"] = from_prior;
  return json;
}

std::optional<SourceUsed> parse_source_used(const nlohmann::ordered_json& json) {
  const auto text = [&](const char* key) {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (!json.is_object() || text("kind").empty()) {
    return std::nullopt;
  }
  SourceUsed used{text("kind"), text("id"), std::nullopt, std::nullopt,
                  json.value("from_prior", nlohmann::ordered_json()) == true};
  if (const auto made_at = parse_iso8601(text("made_at")); made_at) {
    used.made_at = *made_at;
  }
  if (const auto found = json.find("standard_uncertainty_mg");
      found != json.end() && found->is_number()) {
    used.standard_uncertainty_mg = found->get<double>();
  }
  return used;
}

}  // namespace sixpoint::repair
