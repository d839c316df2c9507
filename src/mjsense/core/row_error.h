// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {

// Rows that could not be filled, one fault a world. The episodes of these worlds cannot go on; all
// other rows of the call are there, and other worlds' episodes go on.
struct RowError : ValueError {
  struct Fault {
    int world;
    std::string text;  // names sensor and world
  };
  RowError(int world, const std::string& text) : RowError(std::vector<Fault>{{world, text}}) {}
  explicit RowError(std::vector<Fault> faults)
      : ValueError(faults.at(0).text), faults(std::move(faults)) {}
  std::vector<Fault> faults;
};

}  // namespace mjsense
