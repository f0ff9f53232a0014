#pragma once

#include <rapidcheck.h>

#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/method.hpp"

namespace spectra::fusion::test {

/// A small scene with everything that decides its picture.
struct Case {
  std::string scene;  ///< What kind of temperatures it holds.
  std::vector<float> temperature;
  std::vector<base::Rgb8> visible;
  std::vector<float> baseline;          ///< Empty: none.
  std::vector<std::uint8_t> freshness;  ///< Empty: all fresh.
  fusion::FusionSettings settings;
  fusion::PaletteTable palette{};
  fusion::SceneTemperature facts() const;
  base::VertexValues values() const { return {temperature, visible, baseline, freshness}; }
};

void showValue(const Case& one, std::ostream& out);

/// Temperatures of one of many kinds: uniform, one vertex, none, all missing, random bits, extremes, subnormals, one
/// float step of range, kelvin, one outlier among equals, values on bin edges ...
rc::Gen<std::vector<float>> temperatures();

/// Colours with many that are black, white or grey.
rc::Gen<std::vector<base::Rgb8>> colours(std::size_t count);

/// Any allowed value of a parameter; often a bound, and for temperatures often one of the data's own.
rc::Gen<fusion::ParameterValue> parameter_value(const fusion::Parameter& parameter,
                                                const std::vector<float>& temperature);

/// Valid settings of a method.
rc::Gen<fusion::FusionSettings> settings_of(const fusion::Method& method, const std::vector<float>& temperature);

/// A palette: one of the known ones, one colour only, random, or with steps from one end of the range to the other.
rc::Gen<fusion::PaletteTable> palettes();

rc::Gen<Case> cases(const fusion::Method& method);

}  // namespace spectra::fusion::test
