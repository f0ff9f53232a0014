#include <cmath>
#include <functional>

#include "fusion/demo/noise.hpp"
#include "fusion/demo/office.hpp"

namespace spectra::demo {
namespace {

/// What is printed at a point of a sign, metres from its middle.
using Print = std::function<Colour(double x, double y)>;

/// A thin plate that stands off what is behind it; its rim bends back to it. Temperature knows nothing of the print.
void add_plate(Tessellator& out, const Frame& frame, double width, double height, double relative, double bow_m,
               const Print& print, double warmer_kelvin, double dust, std::uint64_t seed, double glow = 0) {
  out.sheet(width, height, relative, [&](double u, double v) {
    const double x = (u - 0.5) * width, y = (v - 0.5) * height;
    const bool is_rim = u == 0 || u == 1 || v == 0 || v == 1;
    const double bow = bow_m * (4 * (u - 0.5) * (u - 0.5) - 0.3 * v + 0.5 * smooth_noise({x * 6, y * 6, 0}, seed));
    SurfacePoint s;
    s.position = frame.point(x, y, is_rim ? -0.012 : 0.004 + bow);
    const double grime = fractal_noise({x * 9, y * 9, 3}, 3, seed + 1);
    s.colour = print(x, y) * (0.97 + 0.05 * grime);
    s.celsius = ambient_celsius(s.position) + warmer_kelvin;
    s.dust = dust * (0.6 + 0.5 * grime);
    s.glow = glow;
    return s;
  });
}

/// Distance inside a frame line that runs `inset` from the edge of a plate.
bool on_border(double x, double y, double half_width, double half_height, double inset, double thickness) {
  const double to_edge = std::fmin(half_width - std::abs(x), half_height - std::abs(y));
  return to_edge > inset && to_edge < inset + thickness;
}

}  // namespace

void add_signs(Tessellator& out, std::uint64_t seed) {
  constexpr double kFine = 0.175;
  const double edge = out.spacing(kFine);

  Lettering exit;
  exit.add_centred("EXIT", -0.045, -0.059, 0.118, 0.024);
  add_plate(
      out, exit_sign_frame(), 0.56, 0.23, kFine * 1.15, 0.002,
      [&](double x, double y) {
        Colour c{18, 118, 66};
        const double ax = x - 0.235, tip = std::abs(y) + std::abs(ax) * 1.0;
        const bool is_arrow =
            ax > -0.035 && ax < 0.03 && (ax > -0.005 ? tip < 0.04 && ax < 0.035 : std::abs(y) < 0.012);
        if (is_arrow || on_border(x, y, 0.28, 0.115, 0.008, 0.006)) c = {232, 240, 232};
        return mix(c, Colour{240, 246, 240}, exit.ink(x, y, edge));
      },
      0.4, 0.12, seed + 100, 0.25);

  Lettering danger_title, danger_text;
  danger_title.add_centred("DANGER", 0, 0.076, 0.062, 0.0125);
  danger_text.add_centred("400 V", 0.052, -0.055, 0.050, 0.0112);
  danger_text.add_centred("KEEP OUT", 0.0, -0.128, 0.040, 0.0085);
  const Frame danger = danger_sign_frame();
  add_plate(
      out, danger, 0.40, 0.30, kFine, 0.002,
      [&](double x, double y) {
        Colour c{240, 198, 30};
        if (on_border(x, y, 0.20, 0.15, 0.005, 0.006)) c = {24, 22, 20};
        if (y > 0.058) {
          c = on_border(x, y, 0.20, 0.15, -1, 1.006) ? c : Colour{186, 28, 24};
          return mix(c, Colour{248, 244, 236}, danger_title.ink(x, y, edge));
        }
        // The warning triangle with its flash.
        const double tx = x + 0.135, ty = y + 0.020;
        const double inside = std::fmin(ty + 0.044, (0.056 - ty) * 0.5 - std::abs(tx) * 0.87 + 0.0);
        if (inside > 0 && inside < 0.007) c = {24, 22, 20};
        const double bolt = tx + (ty > 0 ? 0.35 * ty - 0.004 : 0.35 * ty + 0.004);
        if (inside > 0.009 && std::abs(bolt) < 0.006) c = {24, 22, 20};
        return mix(c, Colour{22, 20, 18}, danger_text.ink(x, y, edge));
      },
      0.6, 0.15, seed + 101);

  Lettering room;
  room.add_centred("ROOM", -0.122, -0.022, 0.044, 0.0095);
  room.add_centred("2.14", 0.090, -0.030, 0.060, 0.0130);
  add_plate(
      out, facing({0.39, 1.62, -kHalfDepth + 0.03}, {0, 0, 1}).turned(0, 0, 4), 0.44, 0.15, kFine, 0.002,
      [&](double x, double y) {
        const Colour c = on_border(x, y, 0.22, 0.075, 0.004, 0.003) ? Colour{200, 204, 210} : Colour{34, 56, 98};
        return mix(c, Colour{238, 240, 244}, room.ink(x, y, edge));
      },
      0.1, 0.12, seed + 102);

  // A whiteboard above the desk, written on by hand.
  Lettering board_black, board_red, board_blue;
  board_black.add("SHIFT B", -0.50, 0.185, 0.085, 0.013);
  board_blue.add("TEST PUMP 3", -0.50, 0.055, 0.062, 0.010);
  board_blue.add("CALL LAB 14:30", -0.50, -0.060, 0.062, 0.010);
  board_red.add("GAS OFF - VALVE 7", -0.50, -0.185, 0.060, 0.0105);
  add_plate(
      out, facing({-2.42, 1.92, -kHalfDepth + 0.03}, {0, 0, 1}).turned(0, 0, -2), 1.16, 0.66, 0.27, 0.004,
      [&](double x, double y) {
        Colour c = {226, 230, 230};
        if (std::fmin(0.58 - std::abs(x), 0.33 - std::abs(y)) < 0.022) c = {148, 152, 156};
        // Handwriting wavers.
        const double wx = x + 0.004 * smooth_noise({x * 9, y * 9, 1}, 3),
                     wy = y + 0.006 * smooth_noise({x * 5, y * 5, 2}, 4);
        const double e = out.spacing(0.27);
        c = mix(c, Colour{30, 30, 34}, board_black.ink(wx, wy, e));
        c = mix(c, Colour{34, 58, 150}, board_blue.ink(wx, wy, e));
        return mix(c, Colour{176, 30, 34}, board_red.ink(wx, wy, e));
      },
      0.2, 0.12, seed + 103);

  // A note on the desk in front of the screens.
  Lettering note;
  note.add("BACK AT 3", -0.090, 0.034, 0.0205, 0.0046);
  note.add("ANNA", -0.092, -0.024, 0.032, 0.0062);
  note.add("KEY: BOX 5", -0.090, -0.066, 0.0185, 0.0042);
  add_plate(
      out, facing({-2.10, 0.785, -1.90}, {0.05, 1, 0.10}, {0.10, 0, -1}), 0.225, 0.175, 0.115, 0.004,
      [&](double x, double y) {
        const double lined = std::abs((y + 0.5) / 0.011 - std::floor((y + 0.5) / 0.011) - 0.5) < 0.06 ? 0.93 : 1;
        return mix(Colour{244, 230, 132} * lined, Colour{26, 32, 92}, note.ink(x, y, out.spacing(0.115)));
      },
      0.1, 0.10, seed + 104);

  // The label of a box of files on the floor.
  Lettering files;
  files.add_centred("FILES", 0, 0.012, 0.056, 0.0115);
  files.add_centred("2019 - B7", 0, -0.055, 0.030, 0.0065);
  const Frame carton = facing({-1.38, 0.19, -0.35}, {0.25, 0, 1});
  add_plate(
      out, carton.moved(0.02, 0.02, 0.197), 0.30, 0.165, kFine, 0.001,
      [&](double x, double y) {
        const Colour c = on_border(x, y, 0.15, 0.0825, 0.004, 0.003) ? Colour{60, 60, 60} : Colour{236, 234, 226};
        return mix(c, Colour{22, 22, 24}, files.ink(x, y, edge));
      },
      0.0, 0.2, seed + 105);
  const Material cardboard{{172, 132, 88}, {146, 108, 70}, 0.2, 0.002, 0.5, 0.2};
  add_solid_box(out, carton, {0.25, 0.19, 0.19}, 0.008, 0.75, cardboard, seed + 106, false);
}

}  // namespace spectra::demo
