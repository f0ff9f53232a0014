#include <charconv>

#include "fusion/parameter.hpp"

namespace spectra::fusion {

base::Result<ParameterValue> parse_parameter(const Parameter& parameter, std::string_view text) {
  const ParameterValue as_text{std::string(text)};
  const bool automatic = parameter.automatic || parameter.kind == ParameterKind::Temperature;
  if (automatic && (text == "null" || text == "auto")) return ParameterValue{Automatic{}};
  switch (parameter.kind) {
    case ParameterKind::Toggle:
      if (text == "true" || text == "1" || text == "on" || text == "yes") return ParameterValue{true};
      if (text == "false" || text == "0" || text == "off" || text == "no") return ParameterValue{false};
      return validated(parameter, as_text);
    case ParameterKind::Choice:
      return validated(parameter, as_text);
    case ParameterKind::Temperature:
    case ParameterKind::Number:
    case ParameterKind::Integer:
      break;
  }
  std::string_view digits = text;
  if (digits.starts_with('+') && !digits.starts_with("+-")) digits.remove_prefix(1);
  double number = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (end == digits.data() + digits.size() && status == std::errc{}) {
    return validated(parameter, ParameterValue{number});
  }
  // Where a number is asked for, text is refused with the words of the schema.
  base::Error error = validated(parameter, as_text).error();
  if (status == std::errc::result_out_of_range) error.code = base::ErrorCode::OutOfRange;
  return BOOST_OUTCOME_V2_NAMESPACE::failure(std::move(error));
}

}  // namespace spectra::fusion
