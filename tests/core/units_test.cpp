// Numbers and units as text: exactness, dimensions, what is refused.
#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "core/units.h"

namespace varve::core {
namespace {

double value_of(std::string_view text) {
  const auto read = read_quantity(text);
  EXPECT_TRUE(std::holds_alternative<Quantity>(read)) << text;
  return std::holds_alternative<Quantity>(read) ? std::get<Quantity>(read).value : NAN;
}

Dimension dimension_of(std::string_view text) {
  const auto read = read_quantity(text);
  EXPECT_TRUE(std::holds_alternative<Quantity>(read)) << text;
  return std::holds_alternative<Quantity>(read) ? std::get<Quantity>(read).dimension : Dimension{};
}

QuantityError error_of(std::string_view text) {
  const auto read = read_quantity(text);
  EXPECT_TRUE(std::holds_alternative<QuantityError>(read)) << text;
  return std::holds_alternative<QuantityError>(read) ? std::get<QuantityError>(read)
                                                     : QuantityError{};
}

TEST(Units, PrefixMovesTheDecimalPointBeforeRounding) {
  EXPECT_EQ(value_of("1.1 cm"), 0.011);
  EXPECT_NE(1.1 * 0.01, 0.011);  // what multiplying would give
  EXPECT_EQ(value_of("2.5 mm"), 2.5e-3);
  EXPECT_EQ(value_of("300 um"), 3e-4);
  EXPECT_EQ(value_of("0.5ms"), 0.5e-3);
  EXPECT_EQ(value_of("1.1 g/cm3"), 1100.0);
  EXPECT_EQ(value_of("10 cP"), 0.01);
  EXPECT_EQ(value_of("5 %"), 0.05);
  EXPECT_EQ(value_of("1e-2 km"), 10.0);
  EXPECT_EQ(value_of("+.5e+1"), 5.0);
  EXPECT_EQ(value_of("2 min"), 120.0);
  EXPECT_DOUBLE_EQ(value_of("1 in"), 0.0254);
}

TEST(Units, ProductsAndPowersGiveTheirDimension) {
  EXPECT_EQ(dimension_of("6 cm"), (Dimension{0, 1, 0}));
  EXPECT_EQ(dimension_of("1000 kg/m3"), (Dimension{1, -3, 0}));
  EXPECT_EQ(dimension_of("10 mPa.s"), (Dimension{1, -1, -1}));
  EXPECT_EQ(dimension_of("10 mPa s"), (Dimension{1, -1, -1}));
  EXPECT_EQ(dimension_of("10 mPa*s"), (Dimension{1, -1, -1}));
  EXPECT_EQ(dimension_of("9.81 m/s2"), (Dimension{0, 1, -2}));
  EXPECT_EQ(dimension_of("3 1/s"), (Dimension{0, 0, -1}));
  EXPECT_EQ(dimension_of("9.81 m/s^2"), (Dimension{0, 1, -2}));
  EXPECT_EQ(dimension_of("9.81 m s^-2"), (Dimension{0, 1, -2}));
  EXPECT_EQ(dimension_of("3 kN/m"), (Dimension{1, 0, -2}));
  EXPECT_EQ(dimension_of("50 kHz"), (Dimension{0, 0, -1}));
  EXPECT_EQ(dimension_of("2 /s"), (Dimension{0, 0, -1}));
  EXPECT_EQ(value_of("10 mPa.s"), 0.01);
  EXPECT_EQ(value_of("36 km/h"), 10.0);
}

TEST(Units, AnglesAreKnownAsSuch) {
  const auto degrees = std::get<Quantity>(read_quantity("180 deg"));
  EXPECT_TRUE(degrees.is_angle);
  EXPECT_DOUBLE_EQ(degrees.value, 3.14159265358979323846);
  EXPECT_FALSE(std::get<Quantity>(read_quantity("0.5")).is_angle);
}

TEST(Units, WhatIsNoQuantityIsToldApart) {
  for (const char* text : {"", "lots", "-", ".", "e5", "cm", "0,5"}) {
    const QuantityError expected =
        std::string(text) == "0,5" ? QuantityError::unknown_unit : QuantityError::not_a_number;
    EXPECT_EQ(error_of(text), expected) << text;
  }
  for (const char* text : {"nan", "NaN", "inf", "-inf", "+Infinity", "inf s"})
    EXPECT_EQ(error_of(text), QuantityError::not_finite) << text;
  for (const char* text : {"1e999", "-1e400", "1e99999999999999999999", "9e307 km"})
    EXPECT_EQ(error_of(text), QuantityError::too_large) << text;
  for (const char* text : {"5 furlongs", "5 m/", "5 m//s", "5 m^", "5 m0", "5 m99", "1e5x", "0x10",
                           "5 cm ; half", "1 m.m.m.m.m.m.m"})
    EXPECT_EQ(error_of(text), QuantityError::unknown_unit) << text;
}

TEST(Units, NumberTextReadsBackToTheSameBits) {
  for (double value : {0.0, 0.1, 1.0 / 3.0, 6e-2, 5e-324, 1.7976931348623157e308, 12345678.9,
                       -0.25, 2.2250738585072014e-308})
    EXPECT_EQ(value_of(number_text(value)), value);
  EXPECT_TRUE(std::signbit(value_of(number_text(-0.0))));
  EXPECT_EQ(number_text(std::numeric_limits<double>::quiet_NaN()), "auto");
}

TEST(Units, SafeNumbersNeverPassTheLimit) {
  for (int i = 1; i < 2000; ++i) {
    const double value = 1.0 / i + 1e-7 * i;
    EXPECT_LE(value_of(number_below(value)), value);
    EXPECT_GE(value_of(number_below(value)), value * (1 - 1.0001e-5));
    EXPECT_GE(value_of(number_above(value)), value);
    EXPECT_LE(value_of(number_above(value)), value * (1 + 1.0001e-5));
  }
}

TEST(Units, DimensionsHaveNames) {
  EXPECT_EQ(dimension_name({0, 1, 0}), "a length");
  EXPECT_EQ(dimension_name({1, -1, -1}), "a viscosity");
  EXPECT_EQ(dimension_name({}), "a pure number");
  EXPECT_EQ(dimension_name({0, 5, -1}), "a quantity in m^5 s^-1");
}

}  // namespace
}  // namespace varve::core
