#include "fusion/parameter.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace spectra::fusion {
namespace {

Parameter parameter(ParameterKind kind) {
  Parameter result;
  result.name = "strength";
  result.kind = kind;
  result.min = 0;
  result.max = 4;
  result.options = {"both", "hot"};
  return result;
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Parameter, NumberAcceptsItsBoundsAndIntegers) {
  const Parameter number = parameter(ParameterKind::Number);
  EXPECT_EQ(validated(number, 0.0).value(), ParameterValue{0.0});
  EXPECT_EQ(validated(number, 4.0).value(), ParameterValue{4.0});
  EXPECT_EQ(validated(number, std::int64_t{3}).value(), ParameterValue{3.0});
}

TEST(Parameter, NegativeZeroBecomesZero) {
  const ParameterValue value = validated(parameter(ParameterKind::Number), -0.0).value();
  EXPECT_FALSE(std::signbit(std::get<double>(value)));
}

TEST(Parameter, NumberOutsideItsBoundsIsRefusedWithNameAndLimits) {
  const Parameter number = parameter(ParameterKind::Number);
  for (const double bad : {-0.001, 4.001, kNan, kInfinity, -kInfinity}) {
    const auto result = validated(number, bad);
    ASSERT_TRUE(result.has_error()) << bad;
    EXPECT_EQ(result.error().code, base::ErrorCode::OutOfRange);
    EXPECT_EQ(result.error().field, "strength");
    EXPECT_NE(result.error().message.find("strength"), std::string::npos);
    EXPECT_NE(result.error().message.find("of at least 0 and of at most 4"), std::string::npos)
        << result.error().message;
  }
}

TEST(Parameter, ExclusiveBoundIsRefusedAndNamed) {
  Parameter exponent = parameter(ParameterKind::Number);
  exponent.exclusive_min = 0;
  const auto result = validated(exponent, 0.0);
  ASSERT_TRUE(result.has_error());
  EXPECT_EQ(result.error().message, "strength must be a finite number above 0 and of at most 4, not 0");
  EXPECT_TRUE(validated(exponent, 1e-300).has_value());
}

TEST(Parameter, NumbersInWordsAreWrittenOut) {
  EXPECT_EQ(number_text(10), "10");
  EXPECT_EQ(number_text(-300), "-300");
  EXPECT_EQ(number_text(1e9), "1000000000");
  EXPECT_EQ(number_text(123.4), "123.4");
  EXPECT_EQ(number_text(9.1), "9.1");
  EXPECT_EQ(number_text(0.0001), "0.0001");
  EXPECT_EQ(number_text(1.0 / 3), "0.3333333333333333");
  EXPECT_EQ(number_text(1e300), "1e+300");
  Parameter number = parameter(ParameterKind::Number);
  number.max = 10;
  EXPECT_EQ(validated(number, -300.0).error().message,
            "strength must be a finite number of at least 0 and of at most 10, not -300");
}

TEST(Parameter, IntegerAcceptsWholeNumbersOnly) {
  const Parameter integer = parameter(ParameterKind::Integer);
  EXPECT_EQ(validated(integer, 3.0).value(), ParameterValue{std::int64_t{3}});
  EXPECT_EQ(validated(integer, std::int64_t{4}).value(), ParameterValue{std::int64_t{4}});
  EXPECT_EQ(validated(integer, 2.5).error().code, base::ErrorCode::WrongType);
  EXPECT_EQ(validated(integer, std::int64_t{5}).error().code, base::ErrorCode::OutOfRange);
  EXPECT_EQ(validated(integer, kNan).error().code, base::ErrorCode::OutOfRange);
  Parameter unbounded = parameter(ParameterKind::Integer);
  unbounded.max = kInfinity;
  EXPECT_EQ(validated(unbounded, 1e300).error().code, base::ErrorCode::OutOfRange);
}

TEST(Parameter, WrongTypeIsRefused) {
  const auto code = [](ParameterKind kind, const ParameterValue& value) {
    return validated(parameter(kind), value).error().code;
  };
  EXPECT_EQ(code(ParameterKind::Number, std::string("1")), base::ErrorCode::WrongType);
  EXPECT_EQ(code(ParameterKind::Number, true), base::ErrorCode::WrongType);
  EXPECT_EQ(code(ParameterKind::Number, Automatic{}), base::ErrorCode::WrongType);
  EXPECT_EQ(code(ParameterKind::Integer, true), base::ErrorCode::WrongType);
  EXPECT_EQ(code(ParameterKind::Toggle, 1.0), base::ErrorCode::WrongType);
  EXPECT_EQ(code(ParameterKind::Choice, std::int64_t{0}), base::ErrorCode::WrongType);
  EXPECT_EQ(code(ParameterKind::Temperature, std::string("warm")), base::ErrorCode::WrongType);
}

TEST(Parameter, ChoiceNamesItsOptions) {
  const auto result = validated(parameter(ParameterKind::Choice), std::string("cold"));
  ASSERT_TRUE(result.has_error());
  EXPECT_EQ(result.error().message, "strength must be one of 'both' 'hot', not 'cold'");
}

TEST(Parameter, TemperatureIsANumberOrAutomatic) {
  Parameter threshold;
  threshold.name = "threshold";
  threshold.kind = ParameterKind::Temperature;
  EXPECT_EQ(validated(threshold, Automatic{}).value(), ParameterValue{Automatic{}});
  EXPECT_EQ(validated(threshold, -273.15).value(), ParameterValue{-273.15});
  EXPECT_EQ(validated(threshold, kInfinity).error().code, base::ErrorCode::OutOfRange);
}

TEST(Parameter, ReadsCommandLineText) {
  EXPECT_EQ(parse_parameter(parameter(ParameterKind::Number), "0.6").value(), ParameterValue{0.6});
  EXPECT_EQ(parse_parameter(parameter(ParameterKind::Number), "+1e0").value(), ParameterValue{1.0});
  EXPECT_EQ(parse_parameter(parameter(ParameterKind::Integer), "4").value(), ParameterValue{std::int64_t{4}});
  EXPECT_EQ(parse_parameter(parameter(ParameterKind::Toggle), "true").value(), ParameterValue{true});
  EXPECT_EQ(parse_parameter(parameter(ParameterKind::Toggle), "off").value(), ParameterValue{false});
  EXPECT_EQ(parse_parameter(parameter(ParameterKind::Choice), "hot").value(), ParameterValue{std::string("hot")});
  Parameter threshold;
  threshold.kind = ParameterKind::Temperature;
  Parameter hue;
  hue.name = "hue";
  EXPECT_TRUE(parse_parameter(hue, "auto").has_error());
  EXPECT_TRUE(validated(hue, Automatic{}).has_error());
  hue.automatic = true;
  EXPECT_EQ(parse_parameter(hue, "auto").value(), ParameterValue{Automatic{}});
  EXPECT_EQ(validated(hue, Automatic{}).value(), ParameterValue{Automatic{}});
  EXPECT_EQ(validated(hue, 30.0).value(), ParameterValue{30.0});
  EXPECT_EQ(parse_parameter(threshold, "auto").value(), ParameterValue{Automatic{}});
  EXPECT_EQ(parse_parameter(threshold, "null").value(), ParameterValue{Automatic{}});
  EXPECT_EQ(parse_parameter(threshold, "36.6").value(), ParameterValue{36.6});
}

TEST(Parameter, RefusesTextThatIsNoValue) {
  for (const char* text : {"", " 1", "1 ", "1x", "--1", "+-1", "++1", "0x10", "auto"}) {
    const auto result = parse_parameter(parameter(ParameterKind::Number), text);
    ASSERT_TRUE(result.has_error()) << text;
    EXPECT_EQ(result.error().code, base::ErrorCode::WrongType) << text;
  }
  for (const char* text : {"nan", "inf", "-inf", "1e999", "5"}) {
    const auto result = parse_parameter(parameter(ParameterKind::Number), text);
    ASSERT_TRUE(result.has_error()) << text;
    EXPECT_EQ(result.error().code, base::ErrorCode::OutOfRange) << text;
  }
  EXPECT_TRUE(parse_parameter(parameter(ParameterKind::Toggle), "TRUE?").has_error());
}

}  // namespace
}  // namespace spectra::fusion
