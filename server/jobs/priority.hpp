#pragma once

namespace spectra::jobs {

/// Priorities on the pool; lower goes first. Tiles have their level, 0 and up, or what ViewerStream gives a viewer who asks for much.
inline constexpr int kAnswerPriority = -1;   ///< Something a person waits for and that takes milliseconds.
inline constexpr int kExportPriority = 100;  ///< Whole files.

}  // namespace spectra::jobs
