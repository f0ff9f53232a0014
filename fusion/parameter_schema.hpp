#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fusion/method.hpp"

namespace spectra::fusion {

/// Binds the members of a method's parameter struct to their schema entries. The member initialisers of Params are
/// the defaults; an entry adds name, label, help, bounds and unit. Used by the methods only.
template <std::default_initializable Params>
class ParameterSchema {
 public:
  ParameterSchema& number(double Params::*member, Parameter entry) {
    entry.kind = ParameterKind::Number;
    return bind<double>(member, std::move(entry));
  }
  ParameterSchema& integer(std::int64_t Params::*member, Parameter entry) {
    entry.kind = ParameterKind::Integer;
    return bind<std::int64_t>(member, std::move(entry));
  }
  ParameterSchema& toggle(bool Params::*member, Parameter entry) {
    entry.kind = ParameterKind::Toggle;
    return bind<bool>(member, std::move(entry));
  }

  /// The enumerators of Enum are numbered from 0 in the order of entry.options.
  template <class Enum>
  ParameterSchema& choice(Enum Params::*member, Parameter entry) {
    entry.kind = ParameterKind::Choice;
    entry.default_value = entry.options.at(static_cast<std::size_t>(Params{}.*member));
    const std::vector<std::string> options = entry.options;
    return add(std::move(entry), [member, options](Params& params, const ParameterValue& value) {
      const std::string& option = std::get<std::string>(value);
      for (std::size_t i = 0; i < options.size(); ++i) {
        if (options[i] == option) params.*member = static_cast<Enum>(i);
      }
    });
  }

  /// What an automatic value is in a scene; the other values are those that are set.
  template <class Value>
  using AutomaticValue = std::function<Value(const Params&, const SceneTemperature&)>;

  /// A temperature; nullopt = automatic, as are the next two.
  ParameterSchema& temperature(std::optional<double> Params::*member, Parameter entry,
                               AutomaticValue<double> automatic) {
    entry.kind = ParameterKind::Temperature;
    entry.unit = "degC";
    return bind_automatic<double>(member, std::move(entry), std::move(automatic));
  }
  ParameterSchema& number(std::optional<double> Params::*member, Parameter entry, AutomaticValue<double> automatic) {
    entry.kind = ParameterKind::Number;
    return bind_automatic<double>(member, std::move(entry), std::move(automatic));
  }
  ParameterSchema& integer(std::optional<std::int64_t> Params::*member, Parameter entry,
                           AutomaticValue<std::int64_t> automatic) {
    entry.kind = ParameterKind::Integer;
    return bind_automatic<std::int64_t>(member, std::move(entry), std::move(automatic));
  }

  const std::vector<Parameter>& entries() const { return entries_; }

  /// The values as a struct; they are complete and valid.
  Params read(const ParameterValues& values) const {
    Params params;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const auto found = values.find(entries_[i].name);
      if (found != values.end()) assign_[i](params, found->second);
    }
    return params;
  }

  ParameterValues resolve(ParameterValues values, const SceneTemperature& scene) const {
    const Params params = read(values);
    for (const auto& [name, automatic] : automatic_) {
      ParameterValue& value = values[name];
      if (std::holds_alternative<Automatic>(value)) value = automatic(params, scene);
    }
    return values;
  }

 private:
  using Assign = std::function<void(Params&, const ParameterValue&)>;

  ParameterSchema& add(Parameter entry, Assign assign) {
    entries_.push_back(std::move(entry));
    assign_.push_back(std::move(assign));
    return *this;
  }

  template <class Value>
  ParameterSchema& bind(Value Params::*member, Parameter entry) {
    entry.default_value = Params{}.*member;
    return add(std::move(entry),
               [member](Params& params, const ParameterValue& value) { params.*member = std::get<Value>(value); });
  }

  template <class Value>
  ParameterSchema& bind_automatic(std::optional<Value> Params::*member, Parameter entry,
                                  AutomaticValue<Value> automatic) {
    entry.default_value = Automatic{};
    entry.automatic = true;
    automatic_.push_back(
        {entry.name, [automatic = std::move(automatic)](const Params& params, const SceneTemperature& scene) {
           return ParameterValue{automatic(params, scene)};
         }});
    return add(std::move(entry), [member](Params& params, const ParameterValue& value) {
      const auto* set = std::get_if<Value>(&value);
      params.*member = set ? std::optional<Value>(*set) : std::nullopt;
    });
  }

  std::vector<Parameter> entries_;
  std::vector<Assign> assign_;
  std::vector<std::pair<std::string, AutomaticValue<ParameterValue>>> automatic_;
};

/// A method from its description, its schema and the function that makes it ready.
template <class Params>
Method make_method(Method description, const ParameterSchema<Params>& schema,
                   PreparedMethod (*prepare)(const Params&, const MethodContext&),
                   base::Result<void> (*check)(const Params&) = nullptr) {
  description.parameters = schema.entries();
  description.check = [schema, check](const ParameterValues& values) -> base::Result<void> {
    if (check) return check(schema.read(values));
    return base::success();
  };
  description.resolve = [schema](const ParameterValues& values, const SceneTemperature& scene) {
    return schema.resolve(values, scene);
  };
  description.prepare = [schema, prepare](const ParameterValues& values, const MethodContext& context) {
    return prepare(schema.read(values), context);
  };
  return description;
}

}  // namespace spectra::fusion
