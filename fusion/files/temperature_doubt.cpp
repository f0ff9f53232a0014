#include "fusion/files/temperature_doubt.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

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

constexpr float kFull = 65'535;
constexpr std::uint64_t kFewestShared = 12;
constexpr std::uint64_t kSharedOneIn = 1000;
constexpr float kFewestCelsius = 5;
/// No scene has nothing colder.
constexpr float kNothingColder = 1000;

bool are_many(std::uint64_t count, const TemperatureFacts& facts) {
  return count >= kFewestShared && kSharedOneIn * count >= facts.finite_count && count < facts.finite_count;
}

/// A number at an end of the temperatures that many have exactly.
struct SharedNumber {
  std::uint64_t count = 0;
  float celsius = 0;
  double in_file = 0;
  float gap = 0;  ///< To the nearest other.
};

/// How far away from all others a number is that stands for no data, in ranges of those others: nines (99, -99.99, 999.9) and the
/// ends of whole numbers are seldom measured, thousands and cold hundreds not often. Anything else may be what a thing has been
/// given; nullopt: it must be far from what things have.
std::optional<float> least_distance(double number) {
  const double size = std::abs(number);
  const auto is = [size](double other) { return std::abs(size - other) < 1e-6 * other; };
  constexpr float kOfNines = 0.25F;
  for (const double power : {1e2, 1e3, 1e4, 1e5, 1e6}) {
    if (is(power - 1) || is(power - 0.1) || is(power - 0.01)) return kOfNines;
  }
  if (is(32'767) || is(32'768) || is(65'535)) return kOfNines;
  const double step = number < 0 ? 100 : 1000;
  return size >= step && std::fmod(size, step) == 0 ? std::optional(1.0F) : std::nullopt;
}

/// That number at one end, where it keeps away from all others. The others reach to `other_end`, told as the least of negatives where
/// that is the highest.
std::optional<SharedNumber> shared_at_end(const TemperatureFacts& facts, const CelsiusScale& scale, bool is_high,
                                          float other_end) {
  const LeastNumber& end = is_high ? facts.high : facts.low;
  if (!are_many(end.count, facts) || !are_many(facts.finite_count - end.count, facts)) return std::nullopt;
  const float gap = end.next - end.value;
  const float range_of_others = -other_end - end.next;
  const float celsius = is_high ? -end.value : end.value;
  // Without the digits that the way to degC and back has made.
  const std::string shown = short_number((static_cast<double>(celsius) - scale.offset) / scale.factor);
  const double in_file = std::strtod(shown.c_str(), nullptr);
  const std::optional<float> distance = least_distance(in_file);
  constexpr float kOfAny = 8, kFewestCelsiusOfAny = 100;
  if (gap < (distance ? kFewestCelsius : kFewestCelsiusOfAny)) return std::nullopt;
  if (gap <= distance.value_or(kOfAny) * range_of_others) return std::nullopt;
  return SharedNumber{end.count, celsius, in_file, gap};
}

/// Those that keep away from all others: the highest, the lowest, or both. Of two each is judged without the other, too.
std::vector<SharedNumber> shared_numbers(const TemperatureFacts& facts, const CelsiusScale& scale) {
  std::vector<SharedNumber> numbers;
  const auto look = [&](float low, float high) {
    numbers.clear();
    if (const auto one = shared_at_end(facts, scale, true, low)) numbers.push_back(*one);
    if (const auto one = shared_at_end(facts, scale, false, high)) numbers.push_back(*one);
    return numbers.size();
  };
  const bool are_others_between = -facts.high.next > facts.low.value && facts.low.next < -facts.high.value;
  if (are_others_between && look(facts.low.next, facts.high.next) == 2) return numbers;
  look(facts.low.value, facts.high.value);
  return numbers;
}

/// Many are exactly 0, and all others, the measured ones of which lie within a range, keep away from it as those do not.
bool zero_stands_alone(const TemperatureFacts& facts, float low, float high) {
  if (!are_many(facts.zero_count, facts) || facts.nearest_zero < kFewestCelsius) return false;
  const float lowest = low < 0 ? low : facts.nearest_zero;
  const float highest = high > 0 ? high : -facts.nearest_zero;
  return 4 * facts.nearest_zero >= highest - lowest;
}

class Doubt {
 public:
  Doubt(const TemperatureFacts& facts, const PlyProperty& property)
      : facts_(facts), property_(property), shared_(shared_numbers(facts, {})) {
    measured_count_ = facts.finite_count - facts.zero_count - facts.full_count;
    hot_count_ = facts.too_hot_count - facts.full_count;
    large_count_ = facts.large_count;
    for (const SharedNumber& shared : shared_) {
      if (shared.celsius == 0 || shared.celsius == kFull) continue;
      measured_count_ -= shared.count;
      if (shared.celsius > kHottest) hot_count_ -= shared.count;
      if (is_large(shared.celsius)) large_count_ -= shared.count;
    }
  }

  std::optional<TemperatureDoubt> find() const {
    const bool is_kelvin = are_most(facts_.kelvin_like_count) || is_kelvin_with_fire();
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
      const bool may_be_counts = hot_count_ > measured_count_ / 2;
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
    if (hot_count_ > measured_count_ / 2) {
      return of_all(std::string("look like counts of a sensor or another quantity: ") + kOwnScale + no_data());
    }
    if (are_mostly_large() && are_whole()) {
      return of_all("are whole numbers that are hard to believe: they may be " + reading("tenths of a degree", 0.1) +
                    ", or " + reading("hundredths", 0.01) + no_data() + highest_as_no_data());
    }
    if (are_mostly_large() && lowest_measured() >= kNothingColder) {
      return of_all("are hard to believe: they may be " + reading("hundredths of a degree", 0.01) + no_data() +
                    highest_as_no_data());
    }
    return of_some();
  }

 private:
  TemperatureDoubt of_all(const std::string& text) const { return {facts_.finite_count, range() + text}; }

  std::optional<TemperatureDoubt> of_some() const {
    TemperatureDoubt doubt;
    const auto ask = [&](std::uint64_t count, const std::string& what, float value) {
      doubt.count += count;
      doubt.message +=
          (doubt.message.empty() ? range() : "; ") + counted(count, "is", "are") + what + ": " + if_none(value);
    };
    if (facts_.too_hot_count > 0) ask(facts_.too_hot_count, " above 3000", highest());
    if (facts_.too_cold_count > 0) ask(facts_.too_cold_count, " below -100", lowest());
    const bool is_zero_alone = zero_stands_alone(facts_, lowest_measured(), highest_measured());
    if (is_zero_alone) {
      const std::string nearest = short_number(static_cast<double>(facts_.nearest_zero));
      ask(facts_.zero_count, " exactly 0 and no other is nearer to it than " + nearest, 0);
    }
    for (const auto& [count, celsius, in_file, gap] : shared_) {
      const bool is_asked = (celsius == highest() && facts_.too_hot_count > 0) ||
                            (celsius == lowest() && facts_.too_cold_count > 0) || (celsius == 0 && is_zero_alone);
      if (is_asked) continue;
      const std::string exactly = value_text(static_cast<double>(celsius), PlyScalar::Float32);
      const std::string nearest = short_number(static_cast<double>(gap));
      ask(count, " exactly " + exactly + " and no other is nearer to it than " + nearest, celsius);
    }
    if (doubt.count > 0) return doubt;
    if (lowest() >= 0 && highest() <= 1 && highest() > lowest()) {
      return of_all(std::string("look like shares of a range: ") + kOwnScale);
    }
    return std::nullopt;
  }

  /// Where a number alone, or a few of it, is above what there can be.
  std::string highest_as_no_data() const {
    if (facts_.too_hot_count == 0 || is_shared(highest()) || highest() == kFull) return "";
    return "; " + if_none(highest());
  }
  static std::string if_none(float celsius) {
    const std::string number = value_text(static_cast<double>(celsius), PlyScalar::Float32);
    return "if " + number + " stands for no data, --no-data " + number;
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
  bool are_mostly_large() const { return 2 * large_count_ > measured_count_; }

  bool is_shared(float celsius) const {
    return std::any_of(shared_.begin(), shared_.end(), [=](const SharedNumber& one) { return one.celsius == celsius; });
  }
  float lowest() const { return facts_.low.value; }
  float highest() const { return -facts_.high.value; }
  /// Without those that many share.
  float lowest_measured() const { return is_shared(lowest()) ? facts_.low.next : lowest(); }
  float highest_measured() const {
    if (is_shared(highest())) return -facts_.high.next;
    const bool has_others = facts_.full_count > 0 && facts_.highest_but_full >= lowest();
    return has_others ? facts_.highest_but_full : highest();
  }
  /// Nothing is colder than air can be in kelvin, and much is like air.
  bool is_kelvin_with_fire() const {
    constexpr float kColdest = 200, kWarm = 320;
    constexpr std::uint64_t kAirOneIn = 4;
    const float least = lowest_measured() == 0 ? facts_.nearest_zero : lowest_measured();
    return lowest() >= 0 && least >= kColdest && least < kWarm && hot_count_ == 0 &&
           kAirOneIn * facts_.kelvin_like_count >= measured_count_;
  }

  std::string range() const {
    return "Temperatures from " + short_number(static_cast<double>(lowest())) + " to " +
           short_number(static_cast<double>(highest())) + ", taken as degC, ";
  }
  std::string no_data() const {
    std::string text;
    if (facts_.full_count > 0) text += "; " + if_none(kFull);
    for (const SharedNumber& shared : shared_) {
      if (shared.celsius != 0 && shared.celsius != kFull) text += "; " + if_none(shared.celsius);
    }
    return text;
  }
  /// What they would be, without 65535. Those below absolute zero count where they tell that these are hundredths.
  std::string celsius(double scale, double offset) const {
    const auto one = [&](float value) { return short_number(scale * static_cast<double>(value) + offset); };
    const bool has_cold = offset == 0 && has_cold_hundredths();
    return one(has_cold ? std::min(lowest_measured(), facts_.cold_low) : lowest_measured()) + " to " +
           one(highest_measured()) + " degC";
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
  const std::vector<SharedNumber> shared_;
  std::uint64_t measured_count_ = 0;               ///< Those that are neither 0 nor 65535 nor shared.
  std::uint64_t hot_count_ = 0, large_count_ = 0;  ///< Of these.
};

}  // namespace

std::optional<TemperatureDoubt> temperature_doubt(const TemperatureFacts& facts, const PlyProperty& property,
                                                  const std::optional<CelsiusScale>& told) {
  if (!told) return Doubt(facts, property).find();
  TemperatureDoubt doubt;
  for (const SharedNumber& shared : shared_numbers(facts, *told)) {
    const std::string number = short_number(shared.in_file);
    doubt.count += shared.count;
    doubt.message += (doubt.message.empty() ? "" : "; ") + counted(shared.count, "temperature is", "temperatures are") +
                     " exactly " + number +
                     " in the file, far from all others: if that stands for no data, --no-data " + number;
  }
  if (doubt.count == 0) return std::nullopt;
  return doubt;
}

}  // namespace spectra::files
