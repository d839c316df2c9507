// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/pixel_owners.h"

#include "mjsense/core/element_count.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"

namespace mjsense::sensors {
namespace {

std::vector<std::int32_t> entity_of_each(const SensorInit& init, mjtObj type) {
  std::vector<std::int32_t> owners(count_of(init.model, type), -1);
  if (init.scene == nullptr) return owners;
  std::int32_t entity = 0;
  for (const scene::Entity& e : init.scene->entities()) {
    for (int id : scene::entity_elements(init.model, init.scene, e.name, type, "camera").ids)
      owners[id] = entity;
    ++entity;
  }
  return owners;
}

}  // namespace

int body_of(const mjModel* m, int object, int id) {
  return object == mjOBJ_GEOM ? m->geom_bodyid[id] : object == mjOBJ_SITE ? m->site_bodyid[id] : -1;
}

PixelOwners::PixelOwners(const SensorInit& init, int width, int height)
    : model_(init.model),
      geom_entity_(entity_of_each(init, mjOBJ_GEOM)),
      flex_entity_(entity_of_each(init, mjOBJ_FLEX)),
      skin_entity_(entity_of_each(init, mjOBJ_SKIN)),
      site_entity_(entity_of_each(init, mjOBJ_SITE)),
      tendon_entity_(entity_of_each(init, mjOBJ_TENDON)),
      scratch_(init.threads,
               std::vector<std::int32_t>(2 * static_cast<std::size_t>(width) * height)) {}

void PixelOwners::complete(render::ImageTargets& targets, int thread) {
  if (targets.segmentation == nullptr) targets.segmentation = scratch_[thread].data();
}

void PixelOwners::write(const render::ImageTargets& image, int begin, int end, std::int32_t* bodies,
                        std::int32_t* entities) const {
  for (int i = begin; i < end; ++i) {
    const int id = image.segmentation[2 * i], type = image.segmentation[2 * i + 1];
    if (bodies != nullptr) bodies[i] = body_of(model_, type, id);
    if (entities != nullptr)
      entities[i] = type == mjOBJ_GEOM     ? geom_entity_[id]
                    : type == mjOBJ_FLEX   ? flex_entity_[id]
                    : type == mjOBJ_SKIN   ? skin_entity_[id]
                    : type == mjOBJ_SITE   ? site_entity_[id]
                    : type == mjOBJ_TENDON ? tendon_entity_[id]
                                           : -1;
  }
}

}  // namespace mjsense::sensors
