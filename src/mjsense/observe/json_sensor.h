#pragma once
// Sensors whose row is JSON text: uint8[str_max_len], sorted keys, no blanks, padded with 0. The
// text is written at the moment of sensing, so that what a policy reads and what a file holds are
// the same bytes.

#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/json.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

// A JSON text that is longer than its row. Never cut: the episode of this world cannot be recorded.
struct RowTooLong : ValueError {
  RowTooLong(int world, const std::string& message) : ValueError(message), world(world) {}
  int world;
};

class JsonSensor : public Sensor {
 public:
  static constexpr int kDefaultLength = 2000;
  // Longest text of a number: "-1.2345678901234567e-123", and the comma after it.
  static constexpr std::size_t kNumberBytes = 25;

  JsonSensor(std::string name, int str_max_len, std::string description, std::string unit = "");
  std::string_view kind() const override { return "json"; }

  // Throws ValueError if the longest text that write() can give does not fit.
  void initialize(const SensorInit& init) override;
  // Throws RowTooLong with the sensor, the size and the limit.
  void compute(const World& world) final;

 protected:
  virtual void write(const World& world, JsonWriter& json) = 0;
  // Bytes of the longest text, where the sensor can know it; 0 where it cannot. Called after
  // prepare().
  virtual std::size_t max_bytes() const { return 0; }
  // What initialize() of a plain sensor does: resolve names.
  virtual void prepare(const SensorInit& /*init*/) {}

 private:
  SensorSpec spec_;
};

}  // namespace mjsense
