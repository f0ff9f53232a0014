#include "fusion/files/temperature_doubt.hpp"

#include <algorithm>

#include "fusion/files/ply_notes.hpp"
#include "fusion/files/ply_values.hpp"
#include "fusion/files/temperature_name.hpp"

namespace spectra::files {

namespace {

constexpr const char* kOwnScale =
    "--temperature-scale A --temperature-offset B (degC = A value + B), or --temperature-property NAME";

/// The unit of kelvin that a name tells where the values do not look like it; nullptr for none.
const char* named_unit(std::optional<TemperatureUnit> named, bool is_kelvin_like, bool is_centikelvin_like) {
  if (is_kelvin_like || is_centikelvin_like) return nullptr;
  if (named == TemperatureUnit::Kelvin) return "kelvin";
  return named == TemperatureUnit::Centikelvin ? "centikelvin" : nullptr;
}

/// Many are exactly 0, and all others keep away from it as measured ones do not.
bool zero_stands_alone(const TemperatureFacts& facts) {
  constexpr std::uint64_t kFewest = 12;
  constexpr std::uint64_t kOneIn = 1000;
  constexpr float kFewestCelsius = 5;
  if (facts.zero_count < kFewest || kOneIn * facts.zero_count < facts.finite_count) return false;
  if (facts.zero_count == facts.finite_count || facts.nearest_zero < kFewestCelsius) return false;
  const float lowest = facts.lowest < 0 ? facts.lowest : facts.nearest_zero;
  const float highest = facts.highest > 0 ? facts.highest : -facts.nearest_zero;
  return 4 * facts.nearest_zero >= highest - lowest;
}

class Doubt {
 public:
  Doubt(const TemperatureFacts& facts, const PlyProperty& property)
      : facts_(facts), property_(property), measured_count_(facts.finite_count - facts.zero_count - facts.full_count) {}

  std::optional<TemperatureDoubt> find() const {
    const bool is_kelvin = are_most(facts_.kelvin_like_count);
    const bool is_tenth_kelvin = are_most(facts_.tenth_kelvin_like_count);
    const bool is_centikelvin = are_most(facts_.centikelvin_like_count);
    const std::optional<TemperatureUnit> named = temperature_name(property_.name).unit;
    const std::string call = "by the name '" + printable(property_.name) + "'";
    if (named == TemperatureUnit::Fahrenheit)
      return of_all("are in Fahrenheit " + call + ": --temperature-unit fahrenheit");
    if (const char* const unit = named_unit(named, is_kelvin, is_centikelvin); unit != nullptr) {
      return of_all(std::string("are in ") + unit + " " + call + " (which would make them " +
                    celsius(named == TemperatureUnit::Kelvin ? 1 : 0.01, -273.15) + "): --temperature-unit " + unit +
                    " where the name is right");
    }
    // The same numbers may be several things: what they would be tells.
    if (has_cold_hundredths() || (has_hot_hundredths() && !is_tenth_kelvin)) {
      const bool may_be_counts = facts_.too_hot_count - facts_.full_count > measured_count_ / 2;
      return of_all(
          "look like " + reading("hundredths of a degree", 0.01) +
          (may_be_counts ? ", or like counts of a sensor or another quantity: " + std::string(kOwnScale) : "") +
          no_data());
    }
    if (is_centikelvin) return of_all("look like hundredths of kelvin: --temperature-unit centikelvin" + no_data());
    if (is_kelvin) {
      const bool may_be_tenths = are_whole() && named != TemperatureUnit::Kelvin;
      return of_all("look like " + (may_be_tenths ? reading("tenths of a degree", 0.1) + ", or like " : "") + "kelvin" +
                    (may_be_tenths ? " (" + celsius(1, -273.15) + ")" : "") + ": --temperature-unit kelvin" +
                    no_data());
    }
    if (is_tenth_kelvin) {
      return of_all("look like " + reading("hundredths of a degree", 0.01) + ", or like tenths of kelvin (" +
                    celsius(0.1, -273.15) + "): --temperature-scale 0.1 --temperature-offset -273.15" + no_data());
    }
    if (size_bytes(property_.type) == 1) {
      return of_all("are of type " + std::string(to_string(property_.type)) +
                    " and look like grey values: --temperature-scale A --temperature-offset B (degC = A value + B)");
    }
    if (facts_.too_hot_count - facts_.full_count > measured_count_ / 2) {
      return of_all(std::string("look like counts of a sensor or another quantity: ") + kOwnScale + no_data());
    }
    if (are_whole() && facts_.too_hot_count == 0 && are_mostly_large()) {
      return of_all("are whole numbers that are hard to believe: they may be " + reading("tenths of a degree", 0.1) +
                    ", or " + reading("hundredths", 0.01));
    }
    return of_some();
  }

 private:
  TemperatureDoubt of_all(const std::string& text) const { return {facts_.finite_count, range() + text}; }

  std::optional<TemperatureDoubt> of_some() const {
    const auto asked = [this](std::uint64_t count, const std::string& what, float value) -> TemperatureDoubt {
      const std::string text = value_text(static_cast<double>(value), PlyScalar::Float32);
      return {count,
              range() + counted(count, "is", "are") + what + ": if " + text + " stands for no data, --no-data " + text};
    };
    if (facts_.too_hot_count > 0) return asked(facts_.too_hot_count, " above 3000", facts_.highest);
    if (facts_.too_cold_count > 0) return asked(facts_.too_cold_count, " below -100", facts_.lowest);
    if (zero_stands_alone(facts_)) {
      const std::string nearest = short_number(static_cast<double>(facts_.nearest_zero));
      return asked(facts_.zero_count, " exactly 0 and no other is nearer to it than " + nearest, 0);
    }
    if (facts_.lowest >= 0 && facts_.highest <= 1 && facts_.highest > facts_.lowest) {
      return of_all(std::string("look like shares of a range: ") + kOwnScale);
    }
    return std::nullopt;
  }

  bool are_most(std::uint64_t count) const {
    constexpr std::uint64_t kMost = 9;
    return count > 0 && 10 * count >= kMost * measured_count_;
  }
  /// As counts of a fixed step are; a few floats may be whole by chance.
  bool are_whole() const {
    constexpr std::uint64_t kFewest = 12;
    return !facts_.has_fractions && (!is_floating(property_.type) || facts_.finite_count >= kFewest);
  }
  /// Several different values are hotter than anything, or colder than absolute zero, and most of the others are no degrees
  /// either; one value alone may stand for no data.
  bool has_cold_hundredths() const { return facts_.cold_low < facts_.cold_high && are_mostly_large(); }
  bool has_hot_hundredths() const { return facts_.hot_low < facts_.hot_high && are_mostly_large(); }
  bool are_mostly_large() const { return 2 * facts_.large_count > measured_count_; }

  std::string range() const {
    return "Temperatures from " + short_number(static_cast<double>(facts_.lowest)) + " to " +
           short_number(static_cast<double>(facts_.highest)) + ", taken as degC, ";
  }
  std::string no_data() const { return facts_.full_count > 0 ? "; if 65535 stands for no data, --no-data 65535" : ""; }
  /// What they would be, without 65535. Those below absolute zero count where they tell that these are hundredths.
  std::string celsius(double scale, double offset) const {
    const auto one = [&](float value) { return short_number(scale * static_cast<double>(value) + offset); };
    const bool has_cold = offset == 0 && has_cold_hundredths();
    return one(has_cold ? std::min(facts_.lowest, facts_.cold_low) : facts_.lowest) + " to " +
           one(facts_.full_count > 0 && facts_.highest_but_full >= facts_.lowest ? facts_.highest_but_full
                                                                                 : facts_.highest) +
           " degC";
  }
  std::string reading(const std::string& name, double scale) const {
    const std::string none = value_text(static_cast<double>(facts_.coldest_none), PlyScalar::Float32);
    // As tenths it is below absolute zero.
    const bool is_none_possible = facts_.coldest_none < 0 && scale < 0.02;
    return name + " (" + celsius(scale, 0) + "): --temperature-scale " + short_number(scale) +
           (is_none_possible ? " --no-data " + none + " where that stands for none" : "");
  }

  const TemperatureFacts& facts_;
  const PlyProperty& property_;
  const std::uint64_t measured_count_;  ///< Those that are neither 0 nor 65535.
};

}  // namespace

std::optional<TemperatureDoubt> temperature_doubt(const TemperatureFacts& facts, const PlyProperty& property) {
  return Doubt(facts, property).find();
}

}  // namespace spectra::files
