#include "server/sources/block_options.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "fusion/files/ply_values.hpp"

namespace spectra::sources {
namespace {

base::Result<double> number(const std::string& name, std::string_view text, bool may_be_infinite = false) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || std::isnan(value) ||
      (!may_be_infinite && std::isinf(value))) {
    return base::failure(base::ErrorCode::WrongType, name + " is \"" + std::string(text) + "\"; a number is wanted",
                         name);
  }
  return value;
}

base::Result<double> unix_seconds(const std::string& name, std::string_view text) {
  BOOST_OUTCOME_TRY(const double seconds, number(name, text));
  if (files::is_unix_time(seconds)) return seconds;
  const bool is_thousandfold = files::is_unix_time(seconds / 1000);
  return base::failure(base::ErrorCode::OutOfRange,
                       name + " is " + std::string(text) + "; Unix seconds are wanted" +
                           (is_thousandfold ? " (are these milliseconds?)" : ""),
                       name);
}

base::Result<base::Vec3d> place(const std::string& name, std::string_view text) {
  std::array<double, 3> values{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto comma = text.find(',');
    if ((comma == std::string_view::npos) != (i == 2)) {
      return base::failure(base::ErrorCode::WrongType, name + ": three numbers with commas between them are wanted",
                           name);
    }
    BOOST_OUTCOME_TRY(values[i], number(name, text.substr(0, comma)));
    if (i < 2) text.remove_prefix(comma + 1);
  }
  return base::Vec3d{values[0], values[1], values[2]};
}

base::Result<void> read_field(IncomingBlock& block, const std::string& name, const std::string& value) {
  files::ReadOptions& read = block.read;
  if (value.find_first_of("\r\n") != std::string::npos) {
    return base::failure(base::ErrorCode::WrongType, name + " has more than one line", name);
  }
  if (name == "observed_at") {
    BOOST_OUTCOME_TRY(block.observed_at, unix_seconds(name, value));
  } else if (name == "sensor") {
    BOOST_OUTCOME_TRY(block.sensor, place(name, value));
  } else if (name == "temperature_property") {
    read.temperature_property = value;
  } else if (name == "colour_properties") {
    BOOST_OUTCOME_TRY(read.colour_properties, files::colour_properties(value));
  } else if (name == "colour_white") {
    BOOST_OUTCOME_TRY(read.colour_white, number(name, value));
  } else if (name == "temperature_unit") {
    read.temperature_unit = files::temperature_unit(value);
    if (!read.temperature_unit) {
      return base::failure(base::ErrorCode::WrongType,
                           name + " is \"" + value + "\"; celsius, kelvin, centikelvin or fahrenheit is wanted", name);
    }
  } else if (name == "temperature_scale") {
    BOOST_OUTCOME_TRY(read.temperature_scale, number(name, value));
  } else if (name == "temperature_offset") {
    BOOST_OUTCOME_TRY(read.temperature_offset, number(name, value));
  } else if (name == "no_data") {
    BOOST_OUTCOME_TRY(const double no_data, number(name, value, true));
    read.no_data.push_back(no_data);
  } else if (name == "scale") {
    BOOST_OUTCOME_TRY(read.metres_per_unit, number(name, value));
  } else if (name == "up") {
    read.up = base::up_axis_written(value);
    if (!read.up && value != "auto") {
      return base::failure(base::ErrorCode::WrongType,
                           name + " is \"" + value + "\"; x, y, z, -x, -y, -z or auto is wanted", name);
    }
  } else {
    return base::failure(base::ErrorCode::UnknownParameter, "there is no option \"" + name + "\" of a block", name);
  }
  if (name != "observed_at" && name != "sensor") block.read_text += name + '=' + value + '\n';
  return base::success();
}

}  // namespace

std::optional<std::string> repeated_field(const std::vector<std::pair<std::string, std::string>>& query) {
  for (auto field = query.begin(); field != query.end(); ++field) {
    const bool is_again =
        std::any_of(query.begin(), field, [&](const auto& other) { return other.first == field->first; });
    if (is_again && field->first != "no_data") return field->first;
  }
  return std::nullopt;
}

std::string limits_of(std::string_view field) {
  if (field == "observed_at") return "0 to 1e11 seconds since 1970";
  if (field == "scale" || field == "temperature_scale" || field == "colour_white") return "1e-16 to 1e16";
  return "";
}

std::vector<std::pair<std::string, std::string>> query_of(const files::ReadOptions& read) {
  std::vector<std::pair<std::string, std::string>> query;
  if (!read.temperature_property.empty()) query.emplace_back("temperature_property", read.temperature_property);
  std::string colours;
  for (const std::string& name : read.colour_properties) colours += (colours.empty() ? "" : ",") + name;
  if (!colours.empty()) query.emplace_back("colour_properties", colours);
  if (read.colour_white) query.emplace_back("colour_white", files::number_text(*read.colour_white));
  for (const char* name : {"celsius", "kelvin", "centikelvin", "fahrenheit"}) {
    if (read.temperature_unit && read.temperature_unit == files::temperature_unit(name)) {
      query.emplace_back("temperature_unit", name);
    }
  }
  if (read.temperature_scale) query.emplace_back("temperature_scale", files::number_text(*read.temperature_scale));
  if (read.temperature_offset) query.emplace_back("temperature_offset", files::number_text(*read.temperature_offset));
  for (const double value : read.no_data) query.emplace_back("no_data", files::number_text(value));
  if (read.metres_per_unit) query.emplace_back("scale", files::number_text(*read.metres_per_unit));
  if (read.up) query.emplace_back("up", base::to_string(*read.up));
  return query;
}

base::Result<IncomingBlock> incoming_block(std::string id,
                                           const std::vector<std::pair<std::string, std::string>>& query) {
  IncomingBlock block;
  block.id = std::move(id);
  for (const auto& [name, value] : query) {
    BOOST_OUTCOME_TRYV(read_field(block, name, value));
  }
  BOOST_OUTCOME_TRYV(files::check_read_options(block.read));
  return block;
}

base::Result<IncomingBlock> incoming_block(std::string id, const std::string& read_text) {
  std::vector<std::pair<std::string, std::string>> query;
  for (std::size_t begin = 0; begin < read_text.size();) {
    const std::size_t end = std::min(read_text.find('\n', begin), read_text.size());
    const std::string line = read_text.substr(begin, end - begin);
    const auto equals = line.find('=');
    if (equals != std::string::npos) query.emplace_back(line.substr(0, equals), line.substr(equals + 1));
    begin = end + 1;
  }
  return incoming_block(std::move(id), query);
}

}  // namespace spectra::sources
