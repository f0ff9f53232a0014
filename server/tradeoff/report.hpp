#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "server/tradeoff/measure.hpp"

namespace spectra::tradeoff {

/// One line of header and one a row; numbers with a point, missing ones empty.
std::string geometry_csv(const TradeoffMeasurement& measurement);
std::string colours_csv(const TradeoffMeasurement& measurement);
/// Raw layers beside fused colours, for each link and temperature step.
std::string raw_csv(const TradeoffMeasurement& measurement);
/// The full grid of Draco's knobs: every geometry point with every colour point of its level.
std::string grid_csv(const TradeoffMeasurement& measurement);

/// A page that needs nothing else: plots of size against error with the frontier drawn, and all figures as tables.
std::string report_html(const TradeoffMeasurement& measurement, const std::vector<Recommendation>& recommendations);

/// A few lines for a terminal.
std::string recommendation_text(const std::vector<Recommendation>& recommendations);
/// One more, about raw layers; empty where there are none.
std::string raw_text(const TradeoffMeasurement& measurement);

/// Writes geometry.csv, colours.csv, raw.csv, grid.csv and report.html into a folder, made when it does not exist: all of them whole,
/// or none.
base::Result<void> write_report(const std::filesystem::path& folder, const TradeoffMeasurement& measurement,
                                const std::vector<Recommendation>& recommendations);

}  // namespace spectra::tradeoff
