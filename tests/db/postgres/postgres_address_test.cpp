#include "db/postgres/postgres_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::db {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(PostgresAddress, IsShownWithoutThePassword) {
  const auto address = parse_postgres_address("postgresql://ada:s3cret@host:5433/plant");
  ASSERT_OK(address);
  EXPECT_EQ(address->shown, "postgresql://ada@host:5433/plant");
  EXPECT_EQ(address->password, "s3cret");
  EXPECT_THAT(address->connection, HasSubstr("password='s3cret'"));
  EXPECT_THAT(address->connection, HasSubstr("connect_timeout='10'"));
}

TEST(PostgresAddress, QuotesForLibpq) {
  const auto address = parse_postgres_address("postgresql://a%27b:c%5Cd@host/x");
  ASSERT_OK(address);
  EXPECT_THAT(address->connection, HasSubstr("user='a\\'b'"));
  EXPECT_THAT(address->connection, HasSubstr("password='c\\\\d'"));
}

TEST(PostgresAddress, ARefusalDoesNotNameThePassword) {
  for (const char* bad : {"postgresql://ada:s3cret%zz@host/x", "postgresql://ada:s3c@ret@host/x",
                          "postgresql://ada@host/x?s3cret=1"}) {
    const auto refused = parse_postgres_address(bad);
    EXPECT_FAILS(refused, ErrorCode::usage);
    EXPECT_THAT(refused.error().brief(), Not(HasSubstr("s3c")));
  }
}

}  // namespace
}  // namespace sixpoint::db
