// SPDX-License-Identifier: Apache-2.0
#pragma once
// Objects that scenes can name: built-in ones and those of other packages, with what is known about
// them. The tables are models/objects/*.toml: catalogue.toml comes first.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "mjsense_tasks/scenes/scene_file.h"
#include "mjsense_tasks/scenes/scene_split.h"

namespace mjsense::tasks::scenes {

struct ObjectSourceCfg {
  std::string name;
  std::vector<std::string> packages;
  std::string license;
  std::string url;
};
template <class V>
void visit_fields(V& v, ObjectSourceCfg& c) {
  v.object("ObjectSourceCfg", "Where objects come from.");
  v("name", c.name, "Name of the source.").required();
  v("packages", c.packages, "What pip installs; empty: the objects are part of mjsense.");
  v("license", c.license, "Licence of the files.").required();
  v("url", c.url, "Home page.").required();
}

// A rigid part of an object without an MJCF file of its own.
struct CataloguePartCfg {
  std::string mesh;
  std::string texture;
  std::array<double, 4> rgba{1, 1, 1, 1};
  std::array<double, 3> pos{};
  std::array<double, 3> euler{};
  std::optional<std::array<double, 2>> cylinder;
};
template <class V>
void visit_fields(V& v, CataloguePartCfg& c) {
  v.object("CataloguePartCfg", "A mesh of a package.");
  v("mesh", c.mesh, "File of the mesh, ``package:<package>/<file>``.").required();
  v("texture", c.texture, "PNG file of its texture, likewise.").or_none();
  v("rgba", c.rgba, "Colour, which is multiplied with the texture.");
  v("pos", c.pos, "Position of the mesh in the object.").unit("m");
  v("euler", c.euler, "Orientation of the mesh in the object, as in MJCF.").unit("rad");
  // The hull of a disc touches a table at one point: one of 0.12 kg sinks in by 4.5 mm.
  v("cylinder", c.cylinder,
    "Radius and half height of the cylinder about the mesh's z axis that takes part in contacts; "
    "by "
    "default its convex hull does.")
      .unit("m");
}

struct CatalogueObjectCfg {
  std::string name;
  std::string kind;
  std::string source = "mjsense";
  std::string model;
  std::vector<CataloguePartCfg> parts;
  std::string text;
  std::vector<std::string> other_texts;
  std::vector<std::string> rests{"upright"};
  bool receptacle = false;
  std::string color;
  std::string material;
  std::optional<std::array<double, 2>> sizes;
  std::optional<double> mass;
  std::optional<std::array<double, 3>> friction;
  int hidden_group = -1;
  std::string excluded;
};
template <class V>
void visit_fields(V& v, CatalogueObjectCfg& c) {
  v.object("CatalogueObjectCfg", "An object that scenes can name.");
  v("name", c.name, "Name of the object.").required();
  v("kind", c.kind, "Kind of object, such as ``mug``; by default its text.").or_none();
  v("source", c.source, "Name of its source.");
  v("model", c.model, "Its MJCF file; by default a built-in model with its name.").or_none();
  v("parts", c.parts, "Its meshes, instead of a model.");
  v("text", c.text, "Word for it in instructions; by default its name.").or_none();
  v("other_texts", c.other_texts, "Other words for it.");
  v("rests", c.rests, "Poses in which it may rest.").one_of(kRests).not_empty();
  v("receptacle", c.receptacle, "Objects are placed in or on it; it is not picked up.");
  v("color", c.color, "Colour of a receptacle.").or_none();
  v("material", c.material, "Material as an adjective.").or_none();
  v("sizes", c.sizes, "Minimum and maximum scale, instead of the scene's.").within(0.1, 10);
  v("mass", c.mass, "Mass, instead of that of the model.").unit("kg").positive();
  v("friction", c.friction, "Sliding, torsional and rolling friction, instead of the model's.");
  v("hidden_group", c.hidden_group, "As in SceneEntityCfg.").within(-1, 5);
  v("excluded", c.excluded, "Why no task uses it; empty: tasks use it.").or_none();
}

struct ObjectCatalogue {
  std::vector<ObjectSourceCfg> sources;
  std::vector<CatalogueObjectCfg> objects;
};
template <class V>
void visit_fields(V& v, ObjectCatalogue& c) {
  v.object("ObjectCatalogue", "Objects that scenes can name.");
  v("sources", c.sources, "Where they come from.");
  v("objects", c.objects, "The objects.");
}

// Read once.
const ObjectCatalogue& object_catalogue();
// Throws KeyError.
const ObjectSourceCfg& source_of(const CatalogueObjectCfg& object);
// Whether the model is built in, or its package is installed.
bool is_installed(const CatalogueObjectCfg& object);

// Adds the entities and objects of cfg.catalogue to those of the scene, and clears it; of a split
// only the objects of its kinds, and all receptacles. Throws KeyError for an entry that matches no
// object.
SceneFileCfg with_catalogue_objects(SceneFileCfg cfg, std::optional<SceneSplit> split = {});

}  // namespace mjsense::tasks::scenes
