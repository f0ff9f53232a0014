#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

/// Runs a fuzz target over files instead of a fuzzer: every argument is a file or a folder of files. Ends with an error
/// when there was nothing to run.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

void run(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string content{std::istreambuf_iterator<char>(in), {}};
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(content.data()), content.size());
}

}  // namespace

int main(int argument_count, char** arguments) {
  int file_count = 0;
  for (int i = 1; i < argument_count; ++i) {
    const std::filesystem::path path(arguments[i]);
    if (std::filesystem::is_directory(path)) {
      for (const auto& entry : std::filesystem::recursive_directory_iterator(path))
        if (entry.is_regular_file()) {
          run(entry.path());
          ++file_count;
        }
    } else {
      run(path);
      ++file_count;
    }
  }
  std::printf("%d files replayed\n", file_count);
  return file_count > 0 ? 0 : 1;
}
