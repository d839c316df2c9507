// SPDX-License-Identifier: Apache-2.0
#pragma once
// The parts of MuJoCo's abstract scene (mjvScene) that an image depends on. They are read from the
// memory of whichever MuJoCo library owns the scene; the layout of its structs is measured at run
// time, because it differs between versions.

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace mjsense::render {

// Fields have the names and meanings of mjvGeom, mjvLight and mjvGLCamera. A field that the library
// does not have keeps the value given here.
struct AbstractGeom {
  int type = 0, dataid = -1, objtype = 0, objid = -1, category = 0, matid = -1, texcoord = 0,
      segid = -1;
  int texid = -1, texuniform = 0;
  float texrepeat[2] = {1, 1};
  float size[3] = {}, pos[3] = {}, mat[9] = {}, rgba[4] = {};
  float emission = 0, specular = 0, shininess = 0, reflectance = 0;
  char label = 0;  // first character
};

struct AbstractLight {
  int type = -1;  // mjtLightType; -1: this version has `directional` instead
  int directional = 0;
  int castshadow = 0;
  float pos[3] = {}, dir[3] = {};
  float ambient[3] = {}, diffuse[3] = {}, specular[3] = {};
  float attenuation[3] = {1, 0, 0}, cutoff = 0, exponent = 0;
  float intensity = 0, range = 0, bulbradius = 0;
};

struct AbstractCamera {
  float pos[3] = {}, forward[3] = {}, up[3] = {};
  float frustum_center = 0, frustum_width = 0, frustum_bottom = 0, frustum_top = 0,
        frustum_near = 0, frustum_far = 0;
  int orthographic = 0;
};

// Whether all values are finite.
bool is_finite(std::span<const float> values);

// Place of a field in a struct of the library: bytes from the struct's reference address, and its
// size in bytes.
struct FieldPlace {
  std::ptrdiff_t offset;
  std::size_t bytes;
};
using StructLayout = std::map<std::string, FieldPlace>;

// Copies structs of one type out of the library's memory.
class StructReader {
 public:
  // Throws ValueError if `layout` lacks a field that is needed, or if one has another size.
  static StructReader geoms(const StructLayout& layout);
  static StructReader lights(const StructLayout& layout);
  static StructReader cameras(const StructLayout& layout);

  // Fields of `out` that the library does not have are left unchanged.
  template <class T>
  void read(const void* reference, T& out) const {
    copy(static_cast<const char*>(reference), reinterpret_cast<char*>(&out));
  }

 private:
  struct Wanted {
    const char* name;
    std::size_t to, bytes;
    bool integer, needed;
  };
  struct Step {
    std::ptrdiff_t from;
    std::size_t to, bytes;
    bool widen;  // one byte to an int
  };
  StructReader(const char* type, const StructLayout& layout, std::span<const Wanted> fields);
  void copy(const char* from, char* to) const;

  std::vector<Step> steps_;
};

}  // namespace mjsense::render
