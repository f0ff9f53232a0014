#include "server/access/private_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace spectra::access {

std::optional<std::string> write_private_file(const std::filesystem::path& file, const std::string& text) {
  const auto failed = [&] { return file.string() + " cannot be written: " + std::strerror(errno); };
  std::string draft = file.string() + ".XXXXXX";
  const int descriptor = mkstemp(draft.data());  // readable by the owner alone
  if (descriptor < 0) return failed();
  const bool is_written = ::write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                          fsync(descriptor) == 0 && rename(draft.c_str(), file.c_str()) == 0;
  std::optional<std::string> problem;
  if (!is_written) {
    problem = failed();
    unlink(draft.c_str());
  }
  ::close(descriptor);
  return problem;
}

}  // namespace spectra::access
