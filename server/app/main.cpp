#include "server/app/commands.hpp"

int main(int argc, char** argv) {
  return spectra::app::run_program(argc, argv);
}
