#include "station/statistics/distributions.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>

namespace sixpoint::station {

namespace {

// Errors as NaN and infinity instead of exceptions; no promotion to long double, so that results
// are the same everywhere.
namespace policies = boost::math::policies;
using Quiet = policies::policy<
    policies::domain_error<policies::ignore_error>, policies::pole_error<policies::ignore_error>,
    policies::overflow_error<policies::ignore_error>,
    policies::evaluation_error<policies::ignore_error>, policies::promote_double<false>>;

}  // namespace

double normal_quantile(double probability) {
  return boost::math::quantile(boost::math::normal_distribution<double, Quiet>(), probability);
}

double chi_square_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(
      boost::math::chi_squared_distribution<double, Quiet>(degrees_of_freedom), probability);
}

double f_upper_tail(double f, double degrees_of_freedom_1, double degrees_of_freedom_2) {
  return boost::math::cdf(boost::math::complement(
      boost::math::fisher_f_distribution<double, Quiet>(degrees_of_freedom_1, degrees_of_freedom_2),
      f));
}

}  // namespace sixpoint::station
