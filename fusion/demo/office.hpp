#pragma once

#include <cstdint>

#include "fusion/demo/lettering.hpp"
#include "fusion/demo/tessellator.hpp"

namespace spectra::demo {

/// The room: x from -kHalfWidth to kHalfWidth, floor at y = 0, back wall at z = -kHalfDepth, open towards the viewer.
inline constexpr double kHalfWidth = 3.8, kHalfDepth = 2.8, kRoomHeight = 2.9;

/// Air and wall temperature: cool near the floor and towards the open front, warmer at the ceiling.
double ambient_celsius(Vec p);
/// Height of the rubble that covers the floor; the same for every seed, so that what lies on it keeps its place.
double heap_height(double x, double z);
/// Where the person's head, and the back of the hand, are.
Frame head_frame();
Frame hand_frame();
/// Where the things on the desks stand: `up` is up, `out` the front.
Frame left_monitor_frame();
Frame right_monitor_frame();
Frame laptop_frame();
Frame phone_frame();
Frame mug_frame();
Frame bottle_frame();
Frame electrical_box_frame();
Frame exit_sign_frame();
Frame danger_sign_frame();

/// Half sizes, radii and heights that the landmarks need as well.
inline constexpr double kMugRadius = 0.041, kMugHeight = 0.10, kBottleRadius = 0.037, kBottleHeight = 0.27;
inline constexpr double kScreenHalfWidth = 0.29, kScreenHalfHeight = 0.17;

/// The parts of the scene.
void add_room(Tessellator& out, std::uint64_t seed);
void add_signs(Tessellator& out, std::uint64_t seed);
void add_furniture(Tessellator& out, std::uint64_t seed);
void add_desk_things(Tessellator& out, std::uint64_t seed);
void add_rubble(Tessellator& out, std::uint64_t seed);
void add_person(Tessellator& out, std::uint64_t seed);

/// A plain solid: two colours mottled into each other, a temperature above the air, and dust.
struct Material {
  Colour light, dark;
  double grain_m = 0.05;   ///< Size of the mottling.
  double roughness_m = 0;  ///< Height of the bumps.
  double dust = 0.5;
  double warmer_kelvin = 0;
};
/// A point of such a solid.
SurfacePoint solid_point(const Material& material, Vec p, Vec normal, std::uint64_t seed);
/// A bevelled box of it. `frame` is its centre.
void add_solid_box(Tessellator& out, const Frame& frame, Vec half, double bevel, double relative,
                   const Material& material, std::uint64_t seed, bool has_bottom = true);
/// A bar or cable of it through the points a, b, c (a quadratic curve that begins towards b and ends from it).
void add_solid_tube(Tessellator& out, Vec a, Vec b, Vec c, double radius, double relative, const Material& material,
                    std::uint64_t seed);
/// A point of the curve a, b, c at t, and a frame across it (`out` along the curve).
Frame curve_frame(Vec a, Vec b, Vec c, double t);

}  // namespace spectra::demo
