// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/program.h"

int main(int argc, char** argv) { return mjsense::run_program(argc, argv); }
