#include "protocol/jsonrpc.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "protocol/incoming_message.hpp"

namespace spectra::protocol {
namespace {

using nlohmann::json;

/// How much of a client's own text an error repeats.
constexpr std::size_t kQuotedLength = 64;

/// Builds a document while it is read and stops at the first thing that is not allowed.
class GuardedBuilder : public nlohmann::json_sax<json> {
 public:
  explicit GuardedBuilder(const JsonLimits& limits) : limits_(limits) {}

  json& document() { return document_; }
  RpcError refusal_error() const { return {RpcErrorCode::ParseError, "not acceptable JSON: " + reason_, "", limit_}; }

  bool null() override { return add(nullptr) != nullptr; }
  bool boolean(bool value) override { return add(value) != nullptr; }
  bool number_integer(number_integer_t value) override { return add(value) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return add(value) != nullptr; }
  bool number_float(number_float_t value, const string_t& text) override {
    if (!std::isfinite(value)) return refuse("the number " + text.substr(0, kQuotedLength) + " is not finite");
    return add(value) != nullptr;
  }
  bool string(string_t& value) override { return add(std::move(value)) != nullptr; }
  bool binary(binary_t&) override { return refuse("binary values are not part of JSON"); }

  bool start_object(std::size_t) override { return open(json::object()); }
  bool end_object() override { return close(); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    if (containers_.back()->contains(name))
      return refuse("the key \"" + name.substr(0, kQuotedLength) + "\" stands twice in one object");
    key_ = std::move(name);
    return true;
  }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception&) override {
    return refuse("syntax error at byte " + std::to_string(position));
  }

 private:
  bool refuse(std::string reason, std::string limit = {}) {
    reason_ = std::move(reason);
    limit_ = std::move(limit);
    return false;
  }

  /// Puts a value where it belongs; nullptr when there are too many.
  json* add(json value) {
    if (++element_count_ > limits_.max_elements) {
      refuse("too many values", "at most " + std::to_string(limits_.max_elements) + " values");
      return nullptr;
    }
    if (containers_.empty()) return &(document_ = std::move(value));
    json& parent = *containers_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    return &(parent[std::move(key_)] = std::move(value));
  }

  bool open(json container) {
    if (containers_.size() >= static_cast<std::size_t>(limits_.max_depth))
      return refuse("nested too deep", "at most " + std::to_string(limits_.max_depth) + " levels");
    json* added = add(std::move(container));
    if (added != nullptr) containers_.push_back(added);
    return added != nullptr;
  }

  bool close() {
    containers_.pop_back();
    return true;
  }

  JsonLimits limits_;
  json document_;
  /// The containers that are open. A parent does not grow while its child is open, so the pointers stay good.
  std::vector<json*> containers_;
  std::string key_;
  std::size_t element_count_ = 0;
  std::string reason_;
  std::string limit_;
};

std::string text_of(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string text_of(const RpcId& id) {
  return std::visit([](const auto& value) { return text_of(json(value)); }, id);
}

std::optional<RpcId> id_of(const json& value) {
  if (value.is_string()) return RpcId(value.get_ref<const std::string&>());
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX)) return {};
  if (value.is_number_integer()) return RpcId(value.get<std::int64_t>());
  return {};
}

}  // namespace

Result<json> parsed_json(std::string_view text, const JsonLimits& limits) {
  if (text.size() > limits.max_size_bytes)
    return refusal(RpcErrorCode::ParseError, "a message of " + std::to_string(text.size()) + " bytes is too long", "",
                   "at most " + std::to_string(limits.max_size_bytes) + " bytes");
  GuardedBuilder builder(limits);
  if (!json::sax_parse(text.begin(), text.end(), &builder))
    return BOOST_OUTCOME_V2_NAMESPACE::failure(builder.refusal_error());
  return std::move(builder.document());
}

std::variant<IncomingMessage, RefusedMessage> incoming_message(std::string_view text, const JsonLimits& limits) {
  Result<json> parsed = parsed_json(text, limits);
  if (!parsed) return RefusedMessage{{}, parsed.error()};
  json& message = parsed.value();
  IncomingMessage incoming;
  const auto refused = [&incoming](RpcErrorCode code, std::string reason, std::string field, std::string expected) {
    return RefusedMessage{incoming.id, {code, std::move(reason), std::move(field), std::move(expected)}};
  };
  if (message.is_array())
    return refused(RpcErrorCode::InvalidRequest, "batches are not supported", "", "one request or notification");
  if (!message.is_object())
    return refused(RpcErrorCode::InvalidRequest, "a message must be an object", "", "one request or notification");
  if (const auto id = message.find("id"); id != message.end()) {
    incoming.id = id_of(*id);
    if (!incoming.id)
      return refused(RpcErrorCode::InvalidRequest, "id must be a string or an integer", "id",
                     "a string or a 64-bit integer");
  }
  if (const auto version = message.find("jsonrpc"); version == message.end() || *version != "2.0")
    return refused(RpcErrorCode::InvalidRequest, "jsonrpc must be \"2.0\"", "jsonrpc", "\"2.0\"");
  const auto method = message.find("method");
  if (method == message.end() || !method->is_string())
    return refused(RpcErrorCode::InvalidRequest, "method must be a string", "method", "the name of a method");
  incoming.method = std::move(method->get_ref<std::string&>());
  incoming.params = json::object();
  if (const auto params = message.find("params"); params != message.end()) {
    if (!params->is_object())
      return refused(RpcErrorCode::InvalidParams, "params must be an object", "params", "an object");
    incoming.params = std::move(*params);
  }
  return incoming;
}

std::string result_text(const RpcId& id, const json& result) {
  return R"({"jsonrpc":"2.0","id":)" + text_of(id) + R"(,"result":)" + text_of(result) + "}";
}

std::string error_text(const std::optional<RpcId>& id, const RpcError& error) {
  json data{{"field", error.field}, {"reason", error.message}};
  if (!error.limits.empty()) data["limits"] = error.limits;
  const json body{{"code", static_cast<int>(error.code)}, {"message", error.message}, {"data", std::move(data)}};
  return R"({"jsonrpc":"2.0","id":)" + (id ? text_of(*id) : "null") + R"(,"error":)" + text_of(body) + "}";
}

std::string notification_text(std::string_view method, const json& params) {
  return R"({"jsonrpc":"2.0","method":)" + text_of(json(method)) + R"(,"params":)" + text_of(params) + "}";
}

}  // namespace spectra::protocol
