#include "protocol/messages/parameter_value.hpp"

#include "protocol/messages/fields.hpp"

namespace spectra::protocol {

/// A value whose type is told by the JSON itself.
template <>
Result<ParameterValue> Wire<ParameterValue>::read(const nlohmann::json& value, std::string_view path) {
  if (value.is_null()) return ParameterValue(nullptr);
  if (value.is_boolean()) return ParameterValue(value.get<bool>());
  if (value.is_string()) return ParameterValue(value.get_ref<const std::string&>());
  if (value.is_number_integer() && integer_in<std::int64_t>(value))
    return ParameterValue(*integer_in<std::int64_t>(value));
  if (value.is_number() && std::isfinite(value.get<double>())) return ParameterValue(value.get<double>());
  return BOOST_OUTCOME_V2_NAMESPACE::failure(
      unexpected(std::string(path), "a number, a string, true, false or null", value));
}

template <>
nlohmann::json Wire<ParameterValue>::written(const ParameterValue& value) {
  return std::visit(
      []<class Value>(const Value& held) -> nlohmann::json {
        if constexpr (std::same_as<Value, std::nullptr_t>)
          return nullptr;
        else
          return json_of(held);
      },
      value);
}

template <>
Result<ParameterValues> Wire<ParameterValues>::read(const nlohmann::json& value, std::string_view path) {
  if (!value.is_object()) return BOOST_OUTCOME_V2_NAMESPACE::failure(unexpected(std::string(path), "an object", value));
  ParameterValues values;
  for (const auto& [name, item] : value.items()) {
    BOOST_OUTCOME_TRY(auto read, from_json<ParameterValue>(item, std::string(path) + "." + name));
    values.emplace(name, std::move(read));
  }
  return values;
}

template <>
nlohmann::json Wire<ParameterValues>::written(const ParameterValues& values) {
  nlohmann::json object = nlohmann::json::object();
  for (const auto& [name, value] : values) object[name] = to_json(value);
  return object;
}

}  // namespace spectra::protocol
