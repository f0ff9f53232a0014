#include "fusion/parameter.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>

namespace spectra::fusion {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string shown(const ParameterValue& value) {
  struct Visitor {
    std::string operator()(Automatic) const { return "null"; }
    std::string operator()(double number) const { return number_text(number); }
    std::string operator()(std::int64_t integer) const { return std::to_string(integer); }
    std::string operator()(bool toggle) const { return toggle ? "true" : "false"; }
    std::string operator()(const std::string& text) const { return "'" + text + "'"; }
  };
  return std::visit(Visitor{}, value);
}

/// What the parameter takes beside Automatic, as words that follow "must be".
std::string number_expectation(const Parameter& parameter) {
  switch (parameter.kind) {
    case ParameterKind::Toggle:
      return "true or false";
    case ParameterKind::Choice: {
      std::string text = "one of";
      for (const std::string& option : parameter.options) text += " '" + option + "'";
      return text;
    }
    case ParameterKind::Temperature:
      return "a finite temperature in degC";
    case ParameterKind::Number:
    case ParameterKind::Integer:
      break;
  }
  std::string text = parameter.kind == ParameterKind::Integer ? "a whole number" : "a finite number";
  const bool exclusive = parameter.exclusive_min >= parameter.min && parameter.exclusive_min > -kInfinity;
  if (exclusive) {
    text += " above " + number_text(parameter.exclusive_min);
  } else if (parameter.min > -kInfinity) {
    text += " of at least " + number_text(parameter.min);
  }
  if (parameter.max < kInfinity) {
    if (exclusive || parameter.min > -kInfinity) text += " and";
    text += " of at most " + number_text(parameter.max);
  }
  return text;
}

bool allows_automatic(const Parameter& parameter) {
  return parameter.automatic || parameter.kind == ParameterKind::Temperature;
}

std::string expectation(const Parameter& parameter) {
  return number_expectation(parameter) + (allows_automatic(parameter) ? ", or null for automatic" : "");
}

auto refused(base::ErrorCode code, const Parameter& parameter, const std::string& given) {
  return base::failure(code, parameter.name + " must be " + expectation(parameter) + ", not " + given, parameter.name);
}

/// The value as a number if it is one.
std::optional<double> number_in(const ParameterValue& value) {
  if (const auto* number = std::get_if<double>(&value)) return *number;
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return static_cast<double>(*integer);
  return std::nullopt;
}

bool within_bounds(const Parameter& parameter, double number) {
  return number >= parameter.min && number <= parameter.max && number > parameter.exclusive_min;
}

}  // namespace

std::string number_text(double value) {
  // From here on a power of ten is read more easily than its digits.
  constexpr double kLargestWrittenOut = 1e15;
  char buffer[40];
  int digits = 1;
  for (; digits < 17; ++digits) {
    std::snprintf(buffer, sizeof buffer, "%.*g", digits, value);
    if (std::strtod(buffer, nullptr) == value) break;
  }
  // Of fewer digits than a whole number has, %g makes a power of ten: 10 would be 1e+01.
  if (std::abs(value) < kLargestWrittenOut) digits = std::max(digits, 15);
  std::snprintf(buffer, sizeof buffer, "%.*g", digits, value);
  return buffer;
}

std::string_view to_string(ParameterKind kind) {
  switch (kind) {
    case ParameterKind::Number:
      return "number";
    case ParameterKind::Integer:
      return "integer";
    case ParameterKind::Toggle:
      return "toggle";
    case ParameterKind::Choice:
      return "choice";
    case ParameterKind::Temperature:
      return "temperature";
  }
  return "";
}

base::Result<ParameterValue> validated(const Parameter& parameter, const ParameterValue& value) {
  if (std::holds_alternative<Automatic>(value) && allows_automatic(parameter)) return value;
  const std::optional<double> number = number_in(value);
  switch (parameter.kind) {
    case ParameterKind::Toggle:
      if (std::holds_alternative<bool>(value)) return value;
      break;
    case ParameterKind::Choice:
      if (const auto* option = std::get_if<std::string>(&value)) {
        if (std::find(parameter.options.begin(), parameter.options.end(), *option) != parameter.options.end()) {
          return value;
        }
        return refused(base::ErrorCode::OutOfRange, parameter, shown(value));
      }
      break;
    case ParameterKind::Temperature:
    case ParameterKind::Number:
      if (number) {
        if (!std::isfinite(*number) || !within_bounds(parameter, *number)) {
          return refused(base::ErrorCode::OutOfRange, parameter, shown(value));
        }
        // Adding zero turns -0 into 0, so that equal settings are equal in every bit.
        return ParameterValue{*number + 0.0};
      }
      break;
    case ParameterKind::Integer:
      if (number) {
        if (!std::isfinite(*number)) return refused(base::ErrorCode::OutOfRange, parameter, shown(value));
        if (*number != std::floor(*number)) return refused(base::ErrorCode::WrongType, parameter, shown(value));
        // Above 2^53 a double no longer tells whole numbers apart; no parameter goes there.
        if (!within_bounds(parameter, *number) || std::abs(*number) > 9007199254740992.0) {
          return refused(base::ErrorCode::OutOfRange, parameter, shown(value));
        }
        return ParameterValue{static_cast<std::int64_t>(*number)};
      }
      break;
  }
  return refused(base::ErrorCode::WrongType, parameter, shown(value));
}

}  // namespace spectra::fusion
