// The certificate as a digital calibration certificate: PTB's DCC 3.2.0 with D-SI values.
//
//   SIXPOINT_ASSIGN(const Certificate certificate, certificate_of(run));
//   const std::string xml = certificate_dcc(certificate);
//
// Values in SI units, a g of acceleration as 9.80665 m/s2 (the unit's own constants are in standard
// gravity; local gravity is a result of its own). Each judged quantity carries its expanded
// uncertainty, its acceptance limits and its conformity; the statement has the decision rule. What
// the store does not know, the laboratory's address and its customer, is "not stated", the country
// ZZ. The same certificate gives the same bytes.
#pragma once

#include <string>

#include "station/certificate/certificate.h"

namespace sixpoint::station {

std::string certificate_dcc(const Certificate& certificate);

}  // namespace sixpoint::station
