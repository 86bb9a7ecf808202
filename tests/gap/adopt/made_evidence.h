// Diagnoses as documents, made by hand.
#pragma once

#include <string>
#include <vector>

#include "gap/adopt/evidence.h"

namespace sixpoint::tests {

inline gap::EffectEvidence made_effect(const std::string& name, const std::string& parameter,
                                       std::vector<double> value, double sd, bool named = true,
                                       double probability = 0.99) {
  std::vector<double> sds(value.size(), sd);
  return {name, named, false, probability, {{parameter, std::move(value), std::move(sds)}}};
}

inline gap::EffectEvidence made_tempco(std::vector<double> mg_per_c, bool named = true) {
  return made_effect("offset_tempco", "mg_per_c", std::move(mg_per_c), 0.01, named);
}

// Its id is its number: two documents of the same number are one.
inline gap::DocumentEvidence made_document(int number, const std::string& serial,
                                           std::vector<gap::EffectEvidence> effects) {
  gap::DocumentEvidence document;
  document.id = "document " + std::to_string(number);
  document.source = document.id;
  document.serial = serial;
  document.protocol = "engineering";
  document.effects = std::move(effects);
  return document;
}

}  // namespace sixpoint::tests
