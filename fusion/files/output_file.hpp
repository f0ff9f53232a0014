#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "fusion/base/error.hpp"

namespace spectra::files {

/// A file that appears whole or not at all: written beside its final name, synced, then renamed over it; until commit()
/// succeeds the old file stays as it was, and nothing is left behind. What is not a regular file (a pipe, a device, and
/// all below /dev and /proc, such as /dev/stdout) is written directly. A symbolic link stays one: its target is replaced.
/// Every error is FileUnwritable and names the file.
class OutputFile {
 public:
  static base::Result<OutputFile> create(const std::filesystem::path& path);
  /// What would surely fail, known before long work; touches nothing.
  static base::Result<void> check(const std::filesystem::path& path);
  ~OutputFile();  ///< Removes what was written, unless it was committed.
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&& other) noexcept;

  base::Result<void> write(std::span<const std::byte> bytes);
  /// Where the bytes stand until commit(), for those who write them by other means; empty when it is written directly.
  const std::filesystem::path& unfinished() const { return temporary_; }
  /// After this the file is there, and stays there through a power cut.
  base::Result<void> commit();
  /// The same for files that belong together: all are written out first, then put in place one right after the other.
  static base::Result<void> commit_all(std::span<OutputFile> files);

  /// For a process that ends at once: removes every file that was not committed, and holds back all others of this
  /// process that would begin, commit or discard one, for ever. Not safe in a signal handler.
  static void abandon_all();

 private:
  OutputFile() = default;
  base::Result<void> write_out();
  base::Result<void> put_in_place();
  base::Result<void> sync_folder() const;
  base::Error error(const std::string& what, int error_number) const;
  void discard();

  std::filesystem::path path_;       ///< As it was asked for, for messages.
  std::filesystem::path target_;     ///< What is replaced.
  std::filesystem::path temporary_;  ///< Empty when written directly.
  int descriptor_ = -1;
};

}  // namespace spectra::files
