#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

/// Runs a fuzz target without a fuzzer: over files as they are, every argument a file or a folder of files, and then over so many
/// inputs that are made of them by chance, the same in every run.
///   fuzz_NAME [--mutations N] FILE|FOLDER ...
/// Ends with an error when there was nothing to run. An input that ends the program is left behind as ./crash-fuzz_NAME.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
/// There in a program with a sanitizer.
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*callback)());

namespace {

std::string current;
std::string kept_as;

void keep_input() {
  const int file = open(kept_as.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0 && write(file, current.data(), current.size()) >= 0) close(file);
}

extern "C" void on_signal(int number) {
  keep_input();
  std::signal(number, SIG_DFL);
  std::raise(number);
}

/// A sanitizer ends the program by itself, with a report that handlers of signals would take from it.
void keep_what_ends_the_program() {
  std::signal(SIGABRT, on_signal);
  if (__sanitizer_set_death_callback != nullptr) return __sanitizer_set_death_callback(keep_input);
  for (const int number : {SIGSEGV, SIGFPE, SIGILL, SIGBUS}) std::signal(number, on_signal);
}

void run(std::string input) {
  current = std::move(input);
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(current.data()), current.size());
}

std::string content_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& inputs) : inputs_(inputs) {}

  std::string next() {
    std::string input = inputs_[below(inputs_.size())];
    for (std::size_t changes = 1 + below(4); changes > 0; --changes) change(input);
    return input;
  }

 private:
  std::size_t below(std::size_t count) { return count == 0 ? 0 : random_() % count; }

  void change(std::string& input) {
    const std::size_t at = below(input.size() + 1);
    // Short pieces mostly: what is long destroys too much to come far.
    const std::size_t length = std::min(input.size() - at, below(4) == 0 ? below(input.size() + 1) : below(9));
    switch (below(7)) {
      case 0:
        if (at < input.size()) input[at] = static_cast<char>(input[at] ^ (1 << below(8)));
        break;
      case 1: {
        constexpr std::array<unsigned char, 8> kEnds{0, 1, 0x7f, 0x80, 0xfe, 0xff, '9', '-'};
        for (std::size_t i = at; i < at + length; ++i) input[i] = static_cast<char>(kEnds[below(kEnds.size())]);
        break;
      }
      case 2:
        input.erase(at, length);
        break;
      case 3:
        input.insert(at, input.substr(at, length));
        break;
      case 4:
        input.resize(at);
        break;
      case 5: {
        const std::string& other = inputs_[below(inputs_.size())];
        const std::size_t from = below(other.size() + 1);
        input.insert(at, other.substr(from, below(64)));
        break;
      }
      default: {
        constexpr std::array<std::string_view, 12> kWords{
            "nan", "-inf",  "1e999", "-1", "4294967296", "18446744073709551616",
            "{}",  "[[[[[", "\\u00", "\"", "\r\n\r\n",   "%00"};
        input.insert(at, kWords[below(kWords.size())]);
      }
    }
  }

  const std::vector<std::string>& inputs_;
  std::mt19937_64 random_{1};
};

}  // namespace

int main(int argument_count, char** arguments) {
  kept_as = "crash-" + std::filesystem::path(arguments[0]).filename().string();
  keep_what_ends_the_program();
  std::vector<std::filesystem::path> files;
  std::size_t mutation_count = 0;
  for (int i = 1; i < argument_count; ++i) {
    if (std::string_view(arguments[i]) == "--mutations" && i + 1 < argument_count) {
      mutation_count = std::strtoull(arguments[++i], nullptr, 10);
      continue;
    }
    const std::filesystem::path path(arguments[i]);
    if (!std::filesystem::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  std::vector<std::string> inputs;
  for (const auto& file : files) inputs.push_back(content_of(file));
  for (const std::string& input : inputs) run(input);
  if (inputs.empty()) return 1;
  Mutator mutator(inputs);
  for (std::size_t i = 0; i < mutation_count; ++i) run(mutator.next());
  std::printf("%zu files replayed, and %zu inputs made of them\n", inputs.size(), mutation_count);
  return 0;
}
