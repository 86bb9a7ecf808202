#include "gap/explain/catalogue.h"

#include <set>

#include <gtest/gtest.h>

#include "gap/explain/forward.h"

namespace sixpoint::gap {
namespace {

TEST(Catalogue, NamesAreUniqueAndFound) {
  std::set<std::string_view> names;
  for (const CatalogueEntry& entry : catalogue()) {
    EXPECT_TRUE(names.insert(entry.name).second) << entry.name;
    EXPECT_EQ(find_entry(entry.name), &entry);
    EXPECT_FALSE(entry.advice.empty());
    EXPECT_EQ(entry.segment.empty(), (entry.needs & kNever) != 0) << entry.name;
  }
  EXPECT_EQ(names.size(), 31U) << "the contract's list";
  EXPECT_EQ(find_entry("gremlins"), nullptr);
}

TEST(Catalogue, EffectsOfTheMeansAreInIt) {
  for (const ParameterGroup& group : parameter_groups()) {
    EXPECT_EQ(find_entry(group.effect) == nullptr,
              group.effect == "gain" || group.effect == "offset");
    // The least group of an effect is of a twenty-fifth of the typical size, the largest of four
    // times of it.
    EXPECT_LE(group.smallest, 25 * group.prior_sd) << group.effect;
    EXPECT_LE(group.prior_sd, 4 * group.largest) << group.effect;
    EXPECT_LE(group.first + group.count, kForwardParameters);
  }
}

}  // namespace
}  // namespace sixpoint::gap
