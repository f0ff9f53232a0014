#include "server/app/commands.hpp"

int main(int argc, char** argv) {
  return spectra::server::run_program(argc, argv);
}
