// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writes the numeric fields of a sensor as JSON text, one text per step:
// {"arm":[0.1,0.2],"base":[]}.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::record {

// Writes the fields of a sensor as the members of one JSON object. The name of a field is a path:
// "arm" is a member of the object, "gripper/held" is a member of its object "gripper". A scalar
// becomes a value and a row of numbers a list; floats are widened to double first. A bool field
// "given/arm" is not written: if it is false, "arm" is omitted.
class JsonRows {
 public:
  // True if every field has a name and is a number or a row of numbers.
  static bool can_convert(const Sensor& sensor);
  // Throws ValueError if the longest possible text exceeds `text_bytes`, or if one field would be
  // inside another.
  JsonRows(const Sensor& sensor, int text_bytes);

  // Size of a step's raw data, which is kept until its text is written: the rows of all fields,
  // concatenated.
  std::size_t row_bytes() const { return row_bytes_; }
  void copy(int world, std::uint8_t* row) const;
  void write(const std::uint8_t* row, std::span<std::uint8_t> text) const;  // pads with zeros

 private:
  struct Member {
    std::vector<std::string> path;  // {"gripper", "held"}
    const Field* field;
    std::size_t at;                // offset of its numbers in a kept row
    const Field* given = nullptr;  // its "given/..." flag; null if it is always written
    std::size_t given_at = 0;      // offset of the flag in a kept row
  };
  std::size_t longest() const;

  std::vector<Member> members_;  // in the order of nlohmann::json, sorted by name
  std::size_t row_bytes_ = 0;
};

}  // namespace mjsense::record
