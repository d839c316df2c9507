// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/data_copies.h"

#include <cstdint>
#include <vector>

#include "python/bindings/python_sensor.h"

namespace mjsense::python {
namespace {

class DataCopies final : public Sensor {
 public:
  explicit DataCopies(nb::list datas) : Sensor("mjData"), datas_(datas) {
    for (nb::handle data : datas)
      to_.push_back(reinterpret_cast<mjData*>(nb::cast<std::uintptr_t>(data.attr("_address"))));
  }
  std::string_view kind() const override { return "mjdata"; }
  void initialize(const SensorInit&) override { clear_fields(); }
  void compute(const World& world) override { mj_copyData(to_[world.id], world.model, world.data); }

 private:
  PyHandle datas_;
  std::vector<mjData*> to_;
};

}  // namespace

std::shared_ptr<Sensor> make_data_copies(nb::list datas) {
  return std::make_shared<DataCopies>(std::move(datas));
}

}  // namespace mjsense::python
