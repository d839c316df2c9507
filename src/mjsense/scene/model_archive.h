// SPDX-License-Identifier: Apache-2.0
#pragma once
// A scene's model as one file that does not depend on this machine: a zip archive of its MJCF and of
// every file that it refers to.

#include <string>

namespace mjsense::scene {

class Scene;

inline constexpr const char* kArchivedModel = "model.xml";

// Bytes of the archive: kArchivedModel, and meshes, textures, height fields and skins under the
// names by which it refers to them. It compiles to the same model in an empty folder; files that the
// scene reads from disk are in `assets/`. Throws RuntimeError if one of them cannot be read.
std::string model_archive(const Scene& scene);

}  // namespace mjsense::scene
