#include "server/app/invitation.hpp"

#include <qrencode.h>

#include <memory>

namespace spectra::app {

std::string qr_text(const std::string& text) {
  const std::unique_ptr<QRcode, void (*)(QRcode*)> code(
      QRcode_encodeString(text.c_str(), 0, QR_ECLEVEL_M, QR_MODE_8, 1), QRcode_free);
  if (!code) return "";
  constexpr int kMargin = 4;  // of the standard
  const int width = code->width;
  const auto is_dark = [&](int x, int y) {
    const bool is_inside = x >= 0 && y >= 0 && x < width && y < width;
    return is_inside && (code->data[y * width + x] & 1U) != 0;
  };
  std::string picture;
  for (int y = -kMargin; y < width + kMargin; y += 2) {
    picture += "\x1b[30;107m";
    for (int x = -kMargin; x < width + kMargin; ++x) {
      const bool upper = is_dark(x, y), lower = is_dark(x, y + 1);
      picture += upper ? (lower ? "\u2588" : "\u2580") : (lower ? "\u2584" : " ");
    }
    picture += "\x1b[0m\n";
  }
  return picture;
}

}  // namespace spectra::app
