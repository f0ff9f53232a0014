#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "fusion/base/error.hpp"

namespace spectra::fusion {

/// What a parameter is; the word is the wire's (PROTOCOL: METHOD.params[].kind).
enum class ParameterKind { Number, Integer, Toggle, Choice, Temperature };

/// "number", "integer", "toggle", "choice", "temperature".
std::string_view to_string(ParameterKind kind);

/// The shortest text that reads back as the same number; written out below 1e15 ("10", not "1e+01").
std::string number_text(double value);

/// Stands for "automatic": a value that follows the scene. JSON null.
struct Automatic {
  friend bool operator==(Automatic, Automatic) = default;
};

/// The value of one parameter: double for Number and Temperature, int64 for Integer, bool for Toggle, the option's id for
/// Choice; or Automatic where the parameter allows it.
using ParameterValue = std::variant<Automatic, double, std::int64_t, bool, std::string>;

/// Parameter name -> value.
using ParameterValues = std::map<std::string, ParameterValue, std::less<>>;

/// The schema entry of one parameter. It alone drives JSON validation, the command line, the hello message, the
/// form in the browser and the documentation.
struct Parameter {
  std::string name;   ///< snake_case id on the wire and the command line.
  std::string label;  ///< A few words for a form.
  std::string help;   ///< One sentence.
  ParameterKind kind = ParameterKind::Number;
  ParameterValue default_value = {};
  double min = -std::numeric_limits<double>::infinity();            ///< Inclusive; Number and Integer.
  double max = std::numeric_limits<double>::infinity();             ///< Inclusive; Number and Integer.
  double step = 0;                                                  ///< A sensible slider step; 0 = none.
  std::string unit = {};                                            ///< "degC", "deg", "" ...
  std::vector<std::string> options = {};                            ///< Choice only.
  double exclusive_min = -std::numeric_limits<double>::infinity();  ///< A bound that is itself not allowed (k > 0).
  bool automatic = false;  ///< Automatic is allowed; of Temperature it always is.
};

/// Checks type and bounds of one value against its schema; integers are accepted where a number is asked for,
/// and whole numbers where an integer is. The error names the parameter and its limits.
base::Result<ParameterValue> validated(const Parameter& parameter, const ParameterValue& value);

/// Reads the text after `name=` of a command line or query: "null" or "auto" for Automatic.
base::Result<ParameterValue> parse_parameter(const Parameter& parameter, std::string_view text);

}  // namespace spectra::fusion
