#include "server/tradeoff/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <system_error>
#include <utility>

#include "fusion/files/output_file.hpp"

namespace spectra::tradeoff {

namespace {

using Row = std::vector<std::string>;

std::string number(double value, int decimals = 3) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : std::string();
}

const Row kGeometryHeader{"codec",      "level",     "vertices",  "position_step_mm", "encoder_speed",
                          "size_bytes", "encode_ms", "decode_ms", "error_rms_mm",     "error_worst_mm"};
const Row kColourHeader{"codec",          "level",         "colour_bits",
                        "size_bytes",     "encode_ms",     "decode_ms",
                        "ciede2000_mean", "ciede2000_p95", "temperature_p95_celsius"};

Row row_of(const GeometryPoint& p) {
  const std::string speed = p.codec == "draco" ? std::to_string(p.encoder_speed) : std::string();
  return {p.codec,
          std::to_string(p.level),
          std::to_string(p.vertex_count),
          number(p.position_step_mm),
          speed,
          std::to_string(p.size_bytes),
          number(p.encode_ms, 1),
          number(p.decode_ms, 1),
          number(p.error_rms_mm, 4),
          number(p.error_worst_mm, 4)};
}

Row row_of(const ColourPoint& p) {
  return {p.codec,
          std::to_string(p.level),
          std::to_string(p.colour_bits),
          std::to_string(p.size_bytes),
          number(p.encode_ms, 1),
          number(p.decode_ms, 1),
          number(p.ciede2000_mean),
          number(p.ciede2000_p95),
          number(p.temperature_p95_celsius)};
}

std::string csv(const Row& header, const std::vector<Row>& rows) {
  std::string text = fmt::format("{}\n", fmt::join(header, ","));
  for (const Row& row : rows) text += fmt::format("{}\n", fmt::join(row, ","));
  return text;
}

std::vector<Row> rows_of(const auto& points) {
  std::vector<Row> rows;
  for (const auto& point : points) rows.push_back(row_of(point));
  return rows;
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '&':
        result += "&amp;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string table(const Row& header, const std::vector<Row>& rows) {
  std::string html = "<table><thead><tr>";
  for (const auto& cell : header) html += fmt::format("<th>{}</th>", escaped(cell));
  html += "</tr></thead><tbody>";
  for (const Row& row : rows) {
    html += "<tr>";
    for (const auto& cell : row) html += fmt::format("<td>{}</td>", escaped(cell));
    html += "</tr>";
  }
  return html + "</tbody></table>";
}

/// A point of a plot: where, in which series, and what is shown when it is pointed at.
struct Mark {
  double size_kb;
  double error;
  std::string series;
  std::string title;
};

const std::vector<std::pair<std::string, std::string>> kSeries{{"draco", "#1b6ca8"},
                                                               {std::string(kSubtractGreen), "#1e9e8a"},
                                                               {"meshoptimizer", "#b3541e"},
                                                               {"zstd", "#5b7f2b"},
                                                               {"raw", "#777777"}};

/// Points that no other point beats in both size and error, by rising size.
std::vector<Mark> frontier_of(std::vector<Mark> marks) {
  std::sort(marks.begin(), marks.end(), [](const Mark& a, const Mark& b) {
    return a.size_kb != b.size_kb ? a.size_kb < b.size_kb : a.error < b.error;
  });
  std::vector<Mark> frontier;
  double best = std::numeric_limits<double>::infinity();
  for (const Mark& mark : marks) {
    if (mark.error < best) {
      best = mark.error;
      frontier.push_back(mark);
    }
  }
  return frontier;
}

/// Size against error, both logarithmic; errors below `floor` are drawn at the lower edge.
std::string plot(const std::string& heading, const std::string& error_name, const std::vector<Mark>& marks,
                 double floor) {
  constexpr double kWidth = 760, kHeight = 380, kLeft = 70, kBottom = 46, kTop = 14, kRight = 36;
  double low_size = 1e300, high_size = 0, low_error = 1e300, high_error = floor;
  for (const Mark& mark : marks) {
    low_size = std::min(low_size, mark.size_kb);
    high_size = std::max(high_size, mark.size_kb);
    high_error = std::max(high_error, mark.error);
    low_error = std::min(low_error, mark.error);
  }
  const double x0 = std::floor(std::log10(low_size)), x1 = std::max(x0 + 1, std::ceil(std::log10(high_size)));
  const double y0 = std::floor(std::log10(std::max(floor, low_error))),
               y1 = std::max(y0 + 1, std::ceil(std::log10(high_error)));
  const auto x = [&](double kb) { return kLeft + (kWidth - kLeft - kRight) * (std::log10(kb) - x0) / (x1 - x0); };
  const auto y = [&](double error) {
    return kHeight - kBottom - (kHeight - kBottom - kTop) * std::max(0.0, (std::log10(error) - y0) / (y1 - y0));
  };
  std::string svg = fmt::format("<h3>{}</h3><svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">",
                                escaped(heading), kWidth, kHeight, escaped(heading));
  for (double e = x0; e <= x1; ++e) {
    const double at = x(std::pow(10, e));
    svg += fmt::format("<line class=\"grid\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\"/>", at, kTop,
                       kHeight - kBottom);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g} kB</text>", at, kHeight - kBottom + 18,
                       std::pow(10, e));
  }
  for (double e = y0; e <= y1; ++e) {
    const double at = y(std::pow(10, e));
    svg += fmt::format("<line class=\"grid\" x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/>", kLeft,
                       kWidth - kRight, at);
    svg +=
        fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{:g}</text>", kLeft - 8, at + 4, std::pow(10, e));
  }
  svg += fmt::format("<text x=\"{}\" y=\"{}\">{}</text>", kLeft, kHeight - 8, escaped(error_name + " over size"));
  std::string line;
  for (const Mark& mark : frontier_of(marks)) line += fmt::format("{:.1f},{:.1f} ", x(mark.size_kb), y(mark.error));
  svg += fmt::format("<polyline class=\"frontier\" points=\"{}\"/>", line);
  for (const Mark& mark : marks) {
    const auto series =
        std::find_if(kSeries.begin(), kSeries.end(), [&](const auto& s) { return s.first == mark.series; });
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"><title>{}</title></circle>",
                       x(mark.size_kb), y(mark.error), series->second, escaped(mark.title));
  }
  double legend = kLeft + 200;
  for (const auto& [name, colour] : kSeries) {
    if (std::none_of(marks.begin(), marks.end(), [&](const Mark& mark) { return mark.series == name; })) continue;
    svg += fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"4\" fill=\"{}\"/><text x=\"{}\" y=\"{}\">{}</text>", legend,
                       kHeight - 12, colour, legend + 9, kHeight - 8, name);
    legend += 34 + 7 * static_cast<double>(name.size());
  }
  return svg + "</svg>";
}

std::vector<Mark> position_marks(const TradeoffMeasurement& measurement) {
  std::vector<Mark> marks;
  for (const GeometryPoint& p : measurement.geometry) {
    marks.push_back(
        {static_cast<double>(p.size_bytes) / 1000, p.error_rms_mm, p.codec,
         fmt::format(
             "{} level {} step {:.3f} mm speed {}: {:.0f} kB, {:.3f} mm RMS, encode {:.0f} ms, decode {:.0f} ms",
             p.codec, p.level, p.position_step_mm, p.encoder_speed, static_cast<double>(p.size_bytes) / 1000,
             p.error_rms_mm, p.encode_ms, p.decode_ms)});
  }
  return marks;
}

template <class Error>
std::vector<Mark> colour_marks(const TradeoffMeasurement& measurement, Error error) {
  std::vector<Mark> marks;
  for (const ColourPoint& p : measurement.colours) {
    if (!std::isfinite(error(p))) continue;
    marks.push_back(
        {static_cast<double>(p.size_bytes) / 1000, error(p), p.codec,
         fmt::format("{} level {} {} bits: {:.0f} kB, {:.3f}, encode {:.0f} ms, decode {:.0f} ms", p.codec, p.level,
                     p.colour_bits, static_cast<double>(p.size_bytes) / 1000, error(p), p.encode_ms, p.decode_ms)});
  }
  return marks;
}

const Row kRecommendationHeader{"link Mbit/s",         "level",           "position step mm",
                                "colour bits",         "encoder speed",   "first full picture s",
                                "parameter change s",  "position RMS mm", "CIEDE2000 mean",
                                "temperature p95 degC"};

Row row_of(const Recommendation& r) {
  return {number(r.rate_mbit_per_s, 0),
          std::to_string(r.geometry.level),
          number(r.geometry.position_step_mm),
          std::to_string(r.colours.colour_bits),
          std::to_string(r.geometry.encoder_speed),
          number(r.first_picture_s, 2),
          number(r.parameter_change_s, 3),
          number(r.geometry.error_rms_mm),
          number(r.colours.ciede2000_mean, 2),
          number(r.colours.temperature_p95_celsius, 2)};
}

const Row kRawHeader{"link Mbit/s", "temperature step degC",  "temperature bytes",   "visible bytes",
                     "once s",      "each change fused s",    "cheaper from change", "encode ms",
                     "decode ms",   "temperature worst degC", "levels mean",         "levels p95"};
constexpr std::array kRates{1.0, 5.0, 20.0, 100.0};

std::vector<Row> raw_rows(const TradeoffMeasurement& measurement) {
  std::vector<Row> rows;
  for (const double rate : kRates) {
    for (const RawPoint& raw : measurement.raw) {
      const ColourPoint& change = full_change(measurement);
      const auto seconds = [rate](std::uint64_t bytes) { return number(8e-6 * static_cast<double>(bytes) / rate, 3); };
      rows.push_back({number(rate, 0), number(raw.temperature_step_celsius), std::to_string(raw.temperature_bytes),
                      std::to_string(raw.visible_bytes), seconds(raw.size_bytes()), seconds(change.size_bytes),
                      std::to_string(break_even(raw, change)), number(raw.encode_ms, 1), number(raw.decode_ms, 1),
                      number(raw.temperature_worst_celsius, 4), number(raw.levels_mean), number(raw.levels_p95, 0)});
    }
  }
  return rows;
}

/// All of them or none.
base::Result<void> written_files(const std::filesystem::path& folder,
                                 const std::vector<std::pair<const char*, std::string>>& texts) {
  std::vector<files::OutputFile> files;
  for (const auto& [name, text] : texts) {
    BOOST_OUTCOME_TRY(auto file, files::OutputFile::create(folder / name));
    BOOST_OUTCOME_TRYV(file.write(std::as_bytes(std::span(text))));
    files.push_back(std::move(file));
  }
  return files::OutputFile::commit_all(files);
}

}  // namespace

std::string geometry_csv(const TradeoffMeasurement& measurement) {
  return csv(kGeometryHeader, rows_of(measurement.geometry));
}

std::string colours_csv(const TradeoffMeasurement& measurement) {
  return csv(kColourHeader, rows_of(measurement.colours));
}

std::string raw_csv(const TradeoffMeasurement& measurement) {
  Row header = kRawHeader;
  for (std::string& name : header) {
    std::replace(name.begin(), name.end(), ' ', '_');
    std::replace(name.begin(), name.end(), '/', '_');
  }
  return csv(header, raw_rows(measurement));
}

std::string grid_csv(const TradeoffMeasurement& measurement) {
  Row header;
  for (const auto& name : kGeometryHeader) header.push_back("geometry_" + name);
  for (const auto& name : kColourHeader) header.push_back("colours_" + name);
  std::vector<Row> rows;
  for (const GeometryPoint& geometry : measurement.geometry) {
    for (const ColourPoint& colours : measurement.colours) {
      if (geometry.codec != "draco" || !colours.codec.starts_with("draco") || geometry.level != colours.level) continue;
      Row row = row_of(geometry);
      const Row tail = row_of(colours);
      row.insert(row.end(), tail.begin(), tail.end());
      rows.push_back(std::move(row));
    }
  }
  return csv(header, rows);
}

std::string report_html(const TradeoffMeasurement& m, const std::vector<Recommendation>& recommendations) {
  std::string html =
      R"(<!doctype html><html lang="en"><meta charset="utf-8"><title>Speed against accuracy</title><style>
body{font:15px/1.5 system-ui,sans-serif;max-width:1000px;margin:2rem auto;padding:0 1rem;color:#222}
svg{width:100%;height:auto;background:#fafafa;border:1px solid #ddd}svg text{font-size:12px;fill:#333}
.grid{stroke:#e2e2e2}.frontier{fill:none;stroke:#222;stroke-width:1.2;stroke-dasharray:5 3}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:13px;margin:1rem 0}
th,td{padding:2px 8px;border-bottom:1px solid #e4e4e4;text-align:right}th{background:#f3f3f3}details{margin:1rem 0}</style>)";
  html += fmt::format(
      "<h1>{}: speed against accuracy</h1><p>{} vertices, {} triangles, {} levels. One thread; sizes are bytes on the "
      "wire without frame headers. Errors are taken at vertices of the full mesh.</p>",
      escaped(m.scene), m.vertex_count, m.triangle_count, m.level_count);
  std::vector<Row> rows;
  for (const auto& r : recommendations) rows.push_back(row_of(r));
  html += "<h2>Recommended</h2>" + table(kRecommendationHeader, rows);
  html += "<h2>Frontiers</h2>";
  html += plot("Geometry: position error (RMS, mm)", "position RMS mm", position_marks(m), 1e-3);
  html += plot("Colours: difference on the screen (CIEDE2000, mean)", "CIEDE2000 mean",
               colour_marks(m, [](const ColourPoint& p) { return p.ciede2000_mean; }), 1e-2);
  const auto celsius = colour_marks(m, [](const ColourPoint& p) { return p.temperature_p95_celsius; });
  if (!celsius.empty())
    html += plot("Colours: temperature read back (95th percentile, degC)", "degC p95", celsius, 1e-3);
  if (!m.raw.empty()) {
    html +=
        "<h2>Raw layers beside fused colours</h2><p>Full detail. Raw temperatures and visible colours come once; then "
        "the client makes colours by itself, and a change of settings sends none.</p>" +
        table(kRawHeader, raw_rows(m));
  }
  html +=
      "<details><summary>Geometry, all points</summary>" + table(kGeometryHeader, rows_of(m.geometry)) + "</details>";
  html += "<details><summary>Colours, all points</summary>" + table(kColourHeader, rows_of(m.colours)) +
          "</details></html>\n";
  return html;
}

std::string recommendation_text(const std::vector<Recommendation>& recommendations) {
  std::string text;
  for (const Recommendation& r : recommendations) {
    text += fmt::format(
        "{:g} Mbit/s: level {}, position step {:.3f} mm, {} colour bits, encoder speed {}: first full picture {:.2f} "
        "s, "
        "parameter change {:.3f} s, position error {:.3f} mm RMS, CIEDE2000 {:.2f}{}\n",
        r.rate_mbit_per_s, r.geometry.level, r.geometry.position_step_mm, r.colours.colour_bits,
        r.geometry.encoder_speed, r.first_picture_s, r.parameter_change_s, r.geometry.error_rms_mm,
        r.colours.ciede2000_mean,
        std::isfinite(r.colours.temperature_p95_celsius)
            ? fmt::format(", temperature within {:.2f} degC (95 %)", r.colours.temperature_p95_celsius)
            : std::string());
  }
  return text;
}

std::string raw_text(const TradeoffMeasurement& measurement) {
  if (measurement.raw.empty()) return "";
  const RawPoint& raw = measurement.raw.front();
  const ColourPoint& change = full_change(measurement);
  return fmt::format(
      "raw layers: {:.2f} MB once against {:.2f} MB a change, cheaper from change {} on; temperatures within {:.3f} "
      "degC, colours within "
      "{:g} levels (95 %)\n",
      1e-6 * static_cast<double>(raw.size_bytes()), 1e-6 * static_cast<double>(change.size_bytes),
      break_even(raw, change), raw.temperature_worst_celsius, raw.levels_p95);
}

base::Result<void> write_report(const std::filesystem::path& folder, const TradeoffMeasurement& measurement,
                                const std::vector<Recommendation>& recommendations) {
  std::error_code ignored;  // what is wrong with the folder, the first file tells
  const bool is_new = std::filesystem::create_directories(folder, ignored);
  auto written = written_files(folder, {{"geometry.csv", geometry_csv(measurement)},
                                        {"colours.csv", colours_csv(measurement)},
                                        {"raw.csv", raw_csv(measurement)},
                                        {"grid.csv", grid_csv(measurement)},
                                        {"report.html", report_html(measurement, recommendations)}});
  if (!written && is_new) std::filesystem::remove(folder, ignored);
  return written;
}

}  // namespace spectra::tradeoff
