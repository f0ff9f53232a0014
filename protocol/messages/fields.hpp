#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocol/messages/message.hpp"

/// How the messages are read and written. Each struct has one function `describe(fields, message)` that is made from protocol/schema
/// (in this namespace, static, so that it is found from here); FieldReader and FieldWriter run it. For the .cpp files of this folder only.
namespace spectra::protocol {

/// A word of the wire for each enumerator; specialised per enumeration.
template <class Enum>
struct EnumWord {
  Enum value;
  std::string_view word;
};
template <class Enum>
std::span<const EnumWord<Enum>> words_of() = delete;

/// `describe` takes a message that may be const: the parameter type of its second argument.
template <class Given, class Message>
concept Is = std::same_as<std::remove_const_t<Given>, Message>;

/// The kind of a value and, where it is short, the value: what an error says was found.
inline std::string found_text(const nlohmann::json& value) {
  if (value.is_null()) return "null";
  if (value.is_boolean()) return value.get<bool>() ? "true" : "false";
  if (value.is_number()) return value.dump();
  if (value.is_array()) return "a list of " + std::to_string(value.size());
  return value.is_string() ? "a string" : "an object";
}

inline RpcError unexpected(const std::string& path, const std::string& expected, const nlohmann::json& found) {
  return {RpcErrorCode::InvalidParams,
          (path.empty() ? "the message" : path) + " must be " + expected + ", not " + found_text(found), path,
          expected};
}

/// The whole number that a JSON value is, if the type can hold it; 5.0 counts as 5.
template <std::integral Integer>
std::optional<Integer> integer_in(const nlohmann::json& value) {
  if (value.is_number_unsigned()) {
    const auto number = value.get<std::uint64_t>();
    if (std::in_range<Integer>(number)) return static_cast<Integer>(number);
  } else if (value.is_number_integer()) {
    const auto number = value.get<std::int64_t>();
    if (std::in_range<Integer>(number)) return static_cast<Integer>(number);
  } else if (value.is_number_float()) {
    const auto number = value.get<double>();
    // Beyond 2^53 a double no longer names one whole number.
    if (std::abs(number) <= 9007199254740992.0 && std::trunc(number) == number) {
      const auto whole = static_cast<std::int64_t>(number);
      if (std::in_range<Integer>(whole)) return static_cast<Integer>(whole);
    }
  }
  return {};
}

/// Reads values; each `read` returns false after it has noted the error.
class ValueReader {
 public:
  const std::optional<RpcError>& error() const { return error_; }
  void fail(RpcError error) {
    if (!error_) error_ = std::move(error);
  }

  bool read(const nlohmann::json& value, const std::string& path, bool& out) {
    if (!value.is_boolean()) return refuse(path, "true or false", value);
    out = value.get<bool>();
    return true;
  }

  bool read(const nlohmann::json& value, const std::string& path, std::string& out) {
    if (!value.is_string()) return refuse(path, "a string", value);
    out = value.get_ref<const std::string&>();
    return true;
  }

  bool read(const nlohmann::json& value, const std::string& path, double& out) {
    if (!value.is_number() || !std::isfinite(value.get<double>())) return refuse(path, "a number", value);
    out = value.get<double>();
    return true;
  }

  template <std::integral Integer>
  bool read(const nlohmann::json& value, const std::string& path, Integer& out) {
    const std::optional<Integer> number = integer_in<Integer>(value);
    if (!number)
      return refuse(path,
                    "an integer from " + std::to_string(std::numeric_limits<Integer>::min()) + " to " +
                        std::to_string(std::numeric_limits<Integer>::max()),
                    value);
    out = *number;
    return true;
  }

  template <class Enum>
  requires std::is_enum_v<Enum>
  bool read(const nlohmann::json& value, const std::string& path, Enum& out) {
    std::string words;
    for (const EnumWord<Enum>& candidate : words_of<Enum>()) {
      if (value.is_string() && value.get_ref<const std::string&>() == candidate.word) {
        out = candidate.value;
        return true;
      }
      words += (words.empty() ? "\"" : " or \"") + std::string(candidate.word) + "\"";
    }
    return refuse(path, words, value);
  }

  template <class Value, std::size_t count>
  bool read(const nlohmann::json& value, const std::string& path, std::array<Value, count>& out) {
    if (!value.is_array() || value.size() != count) return refuse(path, "a list of " + std::to_string(count), value);
    for (std::size_t i = 0; i < count; ++i)
      if (!read(value[i], path + "[" + std::to_string(i) + "]", out[i])) return false;
    return true;
  }

  template <class Value>
  bool read(const nlohmann::json& value, const std::string& path, std::vector<Value>& out) {
    if (!value.is_array()) return refuse(path, "a list", value);
    out.clear();
    out.reserve(value.size());
    for (std::size_t i = 0; i < value.size(); ++i)
      if (!read(value[i], path + "[" + std::to_string(i) + "]", out.emplace_back())) return false;
    return true;
  }

  /// A message within a message.
  template <class Message>
  requires std::is_class_v<Message>
  bool read(const nlohmann::json& value, const std::string& path, Message& out) {
    Result<Message> message = from_json<Message>(value, path);
    if (!message) {
      fail(message.error());
      return false;
    }
    out = std::move(message).value();
    return true;
  }

  bool refuse(const std::string& path, const std::string& expected, const nlohmann::json& found) {
    fail(unexpected(path, expected, found));
    return false;
  }

 private:
  std::optional<RpcError> error_;
};

/// Fills a message from an object; the first thing that is wrong is the error.
class FieldReader {
 public:
  FieldReader(const nlohmann::json& object, std::string_view path) : object_(object), path_(path) {
    if (!object.is_object()) values_.refuse(path_, "an object", object);
  }

  /// A field that must be there.
  template <class Value>
  void field(const char* key, Value& value) {
    if (const nlohmann::json* found = find(key))
      values_.read(*found, path_of(key), value);
    else
      missing(key);
  }

  /// A field that may be absent.
  template <class Value>
  void optional(const char* key, std::optional<Value>& value) {
    if (const nlohmann::json* found = find(key)) values_.read(*found, path_of(key), value.emplace());
  }

  /// A field that must be there and may be null.
  template <class Value>
  void nullable(const char* key, std::optional<Value>& value) {
    if (find(key) == nullptr) return missing(key);
    optional_or_null(key, value);
  }

  /// A field that may be absent or null.
  template <class Value>
  void optional_or_null(const char* key, std::optional<Value>& value) {
    if (const nlohmann::json* found = find(key); found != nullptr && !found->is_null())
      values_.read(*found, path_of(key), value.emplace());
  }

  /// A list, map or string that is left out when it is empty.
  template <class Container>
  void unless_empty(const char* key, Container& value) {
    if (const nlohmann::json* found = find(key)) values_.read(*found, path_of(key), value);
  }

  /// A condition on a field that has been read; asked only if nothing was wrong before.
  template <std::predicate Condition>
  void require(const char* key, Condition holds, const char* expected) {
    if (values_.error() || holds()) return;
    const nlohmann::json* found = find(key);
    if (found != nullptr)
      values_.refuse(path_of(key), expected, *found);
    else
      missing(key, expected);
  }

  /// The error, if there was one.
  const std::optional<RpcError>& error() const { return values_.error(); }

 private:
  const nlohmann::json* find(const char* key) const {
    if (!object_.is_object()) return nullptr;
    const auto found = object_.find(key);
    return found == object_.end() ? nullptr : &*found;
  }

  std::string path_of(const char* key) const { return path_.empty() ? key : path_ + "." + key; }

  void missing(const char* key, std::string expected = {}) {
    values_.fail({RpcErrorCode::InvalidParams, path_of(key) + " is missing", path_of(key), std::move(expected)});
  }

  const nlohmann::json& object_;
  std::string path_;
  ValueReader values_;
};

template <class Value>
nlohmann::json json_of(const Value& value) {
  if constexpr (std::is_enum_v<Value>) {
    for (const EnumWord<Value>& candidate : words_of<Value>())
      if (candidate.value == value) return candidate.word;
    return nullptr;
  } else if constexpr (std::same_as<Value, double>) {
    if (!std::isfinite(value)) return nullptr;
    return value;
  } else if constexpr (std::integral<Value> || std::same_as<Value, std::string>) {
    return value;
  } else {
    return to_json(value);
  }
}

template <class Value, std::size_t count>
nlohmann::json json_of(const std::array<Value, count>& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const Value& value : values) list.push_back(json_of(value));
  return list;
}

template <class Value>
nlohmann::json json_of(const std::vector<Value>& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const Value& value : values) list.push_back(json_of(value));
  return list;
}

/// Writes a message into an object. A number that is not finite becomes null.
class FieldWriter {
 public:
  template <class Value>
  void field(const char* key, const Value& value) {
    object_[key] = json_of(value);
  }
  template <class Value>
  void optional(const char* key, const std::optional<Value>& value) {
    if (value) object_[key] = json_of(*value);
  }
  template <class Value>
  void nullable(const char* key, const std::optional<Value>& value) {
    object_[key] = value ? json_of(*value) : nlohmann::json(nullptr);
  }
  template <class Value>
  void optional_or_null(const char* key, const std::optional<Value>& value) {
    optional(key, value);
  }
  template <class Container>
  void unless_empty(const char* key, const Container& value) {
    if (!value.empty()) object_[key] = json_of(value);
  }
  void require(const char*, const auto&, const char*) {}

  nlohmann::json object() && { return std::move(object_); }

 private:
  nlohmann::json object_ = nlohmann::json::object();
};

template <class Message>
Result<Message> Wire<Message>::read(const nlohmann::json& value, std::string_view path) {
  Message message;
  FieldReader fields(value, path);
  describe(fields, message);
  if (fields.error()) return BOOST_OUTCOME_V2_NAMESPACE::failure(*fields.error());
  return message;
}

template <class Message>
nlohmann::json Wire<Message>::written(const Message& message) {
  FieldWriter fields;
  describe(fields, message);
  return std::move(fields).object();
}

/// Whether the whole text is what a regular expression (ECMAScript) describes.
bool matches(const std::string& text, const char* pattern);

/// Whether every item of a list keeps to a rule.
template <class List, class Rule>
bool each(const List& list, Rule rule) {
  return std::all_of(list.begin(), list.end(), rule);
}

}  // namespace spectra::protocol
