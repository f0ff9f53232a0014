#include "fusion/files/up_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "fusion/files/comment_words.hpp"

namespace spectra::files {

namespace {

/// A wall this large there is not.
constexpr double kMapExtent = 300;
/// Height to width of a map, at most.
constexpr double kMapFlatness = 0.25;
/// Area that faces up to area that faces along each other axis, at least.
constexpr double kFacing = 1.5;

base::UpAxis opposite(base::UpAxis up) {
  return static_cast<base::UpAxis>((static_cast<int>(up) + 3) % 6);
}

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::optional<double> number_of(const std::string& word) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (end == word.c_str() || *end != '\0' || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The axis that three numbers from `at` on point along.
std::optional<base::UpAxis> axis_of_vector(const std::vector<std::string>& words, std::size_t at) {
  std::array<double, 3> vector{};
  for (double& component : vector) {
    while (at < words.size() && words[at] == ",") ++at;
    if (at >= words.size()) return std::nullopt;
    const auto number = number_of(words[at++]);
    if (!number) return std::nullopt;
    component = *number;
  }
  const double length = std::hypot(vector[0], vector[1], vector[2]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (length > 0 && std::abs(vector[axis]) > 0.9 * length) {
      return static_cast<base::UpAxis>(axis + (vector[axis] < 0 ? 3U : 0U));
    }
  }
  return std::nullopt;
}

/// "Not y up", and "do not use y up".
bool is_denied(const std::vector<std::string>& words, std::size_t at) {
  constexpr std::size_t kWordsBetween = 3;
  for (std::size_t i = at; i > 0 && i + kWordsBetween >= at; --i) {
    if (is_one_of(words[i - 1], {",", "but"})) return false;
    if (is_one_of(words[i - 1], {"not", "never", "no"})) return true;
  }
  return false;
}

/// All that one line says about up.
std::vector<base::UpAxis> told_by(const std::string& line) {
  std::vector<base::UpAxis> told;
  const std::vector<std::string> words = comment_words(line);
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (is_denied(words, i)) continue;
    if (word == "enu") told.push_back(base::UpAxis::Z);
    if (word == "ned") told.push_back(base::UpAxis::MinusZ);
    if (word.size() == 3 && word.ends_with("up")) {
      if (const auto axis = base::up_axis(word.substr(0, 1))) told.push_back(*axis);
    }
    std::size_t next = i + 1;
    if (const auto axis = base::up_axis(word)) {
      const auto is_filler = [](const std::string& w) {
        return is_one_of(w, {"axis", "is", "points", "pointing", "direction", "="});
      };
      while (next < words.size() && is_filler(words[next])) ++next;
      if (next == words.size()) continue;
      // "forward = -z axis up = y": there another axis is named.
      if (next + 1 < words.size() && words[next + 1] == "=") continue;
      // "y up to 3 m" is a size.
      const bool is_size = next + 1 < words.size() && is_one_of(words[next + 1], {"to", "till", "until", "from"});
      if (is_size) continue;
      if (is_one_of(words[next], {"up", "upward", "upwards"})) told.push_back(*axis);
      if (is_one_of(words[next], {"down", "downward", "downwards"})) told.push_back(opposite(*axis));
      const bool is_named = next > i + 1;
      if (is_named && is_one_of(words[next], {"elevation", "height", "altitude", "vertical"})) told.push_back(*axis);
      continue;
    }
    const bool is_vertical =
        is_one_of(word, {"vertical", "height", "elevation"}) && next < words.size() && words[next] == "axis";
    const bool is_down = word == "gravity";
    if (!is_vertical && !is_down && !is_one_of(word, {"up", "upaxis", "upvector"})) continue;
    const auto is_filler = [](const std::string& w) {
      return is_one_of(w, {"axis", "vector", "direction", "dir", "is", "along", "="});
    };
    while (next < words.size() && is_filler(words[next])) ++next;
    // "up x" within a sentence may mean anything, and "pick up: x" something else.
    const std::string_view before = i > 0 ? std::string_view(words[i - 1]) : std::string_view();
    const bool is_end = next + 1 >= words.size() || is_one_of(words[next + 1], {",", "forward"});
    const bool is_phrase = is_one_of(before, {",", "=", "axis", "axes"}) && is_end;
    const bool is_of_scene =
        is_one_of(before, {",", "=", "the", "scene", "world", "camera", "model", "mesh", "map", "frame", "view", "axis",
                           "axes", "coordinate", "coordinates", "system", "handed"});
    const bool is_named =
        next > i + 1 && (is_of_scene || is_one_of(words[i + 1], {"axis", "vector", "direction", "dir"}));
    const bool is_meant = i == 0 || is_phrase || word != "up" || is_named;
    if (!is_meant || next == words.size()) continue;
    auto axis = base::up_axis(words[next]);
    if (!axis) axis = axis_of_vector(words, next);
    if (axis) told.push_back(is_down ? opposite(*axis) : *axis);
  }
  return told;
}

}  // namespace

std::optional<base::UpAxis> up_told(std::span<const std::string> comments) {
  std::optional<base::UpAxis> told;
  for (const std::string& line : comments) {
    for (const base::UpAxis up : told_by(line)) {
      if (told && *told != up) return std::nullopt;
      told = up;
    }
  }
  return told;
}

std::optional<base::UpAxis> up_seen(const mesh::MultispectralMesh& mesh, const base::Bounds& core) {
  const std::array<double, 3> extents = {static_cast<double>(core.max.x) - static_cast<double>(core.min.x),
                                         static_cast<double>(core.max.y) - static_cast<double>(core.min.y),
                                         static_cast<double>(core.max.z) - static_cast<double>(core.min.z)};
  const auto thin = static_cast<std::size_t>(std::min_element(extents.begin(), extents.end()) - extents.begin());
  const double width = std::min(extents[(thin + 1) % 3], extents[(thin + 2) % 3]);
  if (width < kMapExtent || extents[thin] > kMapFlatness * width) return std::nullopt;
  if (mesh.is_point_cloud()) return static_cast<base::UpAxis>(thin);

  // Twice the area as seen along each axis. Which side of it is the outer one tells nothing: many programs do not care.
  std::array<double, 3> facing{};
  const std::span<const base::Vec3f> positions = mesh.positions();
  for (const base::Triangle& triangle : mesh.triangles()) {
    const auto edge = [&](std::size_t corner) -> std::array<double, 3> {
      const base::Vec3f& a = positions[triangle[0]];
      const base::Vec3f& b = positions[triangle[corner]];
      return {static_cast<double>(b.x) - static_cast<double>(a.x), static_cast<double>(b.y) - static_cast<double>(a.y),
              static_cast<double>(b.z) - static_cast<double>(a.z)};
    };
    const auto u = edge(1);
    const auto v = edge(2);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t j = (axis + 1) % 3;
      const std::size_t k = (axis + 2) % 3;
      facing[axis] += std::abs(u[j] * v[k] - u[k] * v[j]);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axis != thin && facing[thin] < kFacing * facing[axis]) return std::nullopt;
  }
  return static_cast<base::UpAxis>(thin);
}

}  // namespace spectra::files
