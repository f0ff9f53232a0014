#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <variant>

#include "protocol/messages/message.hpp"

namespace spectra::protocol {

/// The value of a fusion parameter on the wire: null (automatic), number, integer, toggle or choice.
using ParameterValue = std::variant<std::nullptr_t, double, std::int64_t, bool, std::string>;
using ParameterValues = std::map<std::string, ParameterValue, std::less<>>;

template <>
Result<ParameterValue> Wire<ParameterValue>::read(const nlohmann::json& value, std::string_view path);
template <>
nlohmann::json Wire<ParameterValue>::written(const ParameterValue& value);
template <>
Result<ParameterValues> Wire<ParameterValues>::read(const nlohmann::json& value, std::string_view path);
template <>
nlohmann::json Wire<ParameterValues>::written(const ParameterValues& values);

}  // namespace spectra::protocol
