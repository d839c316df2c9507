// SPDX-License-Identifier: Apache-2.0
#pragma once
// Scene files, the data that defines where episodes take place: models, the objects among them and
// their placement, the pose of the robot, and what varies between episodes.

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/scene/default_lighting.h"
#include "mjsense/scene/physics_options.h"
#include "mjsense/scene/scene.h"

namespace mjsense::tasks::scenes {

struct SceneEntityCfg {
  std::string name;
  std::string model;
  std::array<double, 3> pos{};
  std::array<double, 4> quat{1, 0, 0, 0};
  bool free = false;
  std::vector<std::string> without;
  std::optional<std::array<int, 2>> inertia_groups;
  int hidden_group = -1;
  std::optional<double> mass;
  std::optional<std::array<double, 3>> friction;
};
template <class V>
void visit_fields(V& v, SceneEntityCfg& c) {
  v.object("SceneEntityCfg", "A model of a scene; its names get the prefix ``<name>/``.");
  v("name", c.name, "Name of the entity.").required();
  v("model", c.model,
    "An MJCF file: a path relative to the scene's file, ``embedded:<file>``, or "
    "``package:<package>/<file>`` of an installed Python package.")
      .required();
  v("pos", c.pos, "Position of the model.").unit("m");
  v("quat", c.quat, "Orientation of the model, wxyz.");
  v("free", c.free,
    "Give its body a free joint, which models of single objects often lack; a body without a name "
    "is named after the entity.");
  v("without", c.without,
    "Bodies whose whole kinematic tree is removed, such as the robot of a model that includes "
    "one.");
  v("inertia_groups", c.inertia_groups,
    "First and last group of the geoms whose masses count, instead of the model's setting.");
  v("hidden_group", c.hidden_group,
    "Group of geoms that take part in contacts but are invisible; -1: groups 3 and up.")
      .within(-1, 5);
  v("mass", c.mass, "Mass of the whole model, instead of that of its file.").unit("kg").positive();
  v("friction", c.friction,
    "Sliding, torsional and rolling friction of its geoms, instead of those of its file.");
}

// Resting orientations of an object: as in its model, on its side (rotated about y), on its end
// (rotated about x).
inline constexpr std::array<std::string_view, 3> kRests{"upright", "side", "end"};

struct SceneObjectCfg {
  std::string body;
  std::string text;
  std::vector<std::string> other_texts;
  std::vector<std::string> rests{"upright"};
  bool receptacle = false;
  std::string color;
  std::string material;
  std::optional<std::array<double, 2>> sizes;
};
template <class V>
void visit_fields(V& v, SceneObjectCfg& c) {
  v.object("SceneObjectCfg", "A body with a free joint that a task may use.");
  v("body", c.body, "Full name in the scene, such as ``mug/mug``.").required();
  v("text", c.text, "Word for the object in instructions; by default the last part of its name.")
      .or_none();
  v("other_texts", c.other_texts, "Other words for the object.");
  v("rests", c.rests, "Poses in which it may rest.").one_of(kRests).not_empty();
  v("receptacle", c.receptacle, "Objects are placed in or on it; it is not picked up.");
  v("color", c.color, "Colour of a receptacle, which distinguishes it from others of its kind.")
      .or_none();
  v("material", c.material,
    "Material as an adjective in instructions: ``wooden``, ``metal``. By default it is not "
    "mentioned.")
      .or_none();
  v("sizes", c.sizes, "Minimum and maximum scale of this object, instead of the scene's.")
      .within(0.1, 10);
}

struct SceneRegionCfg {
  std::string name;
  std::string on;
  std::array<double, 4> area{};
  std::optional<std::array<double, 4>> target_area;
  std::string text;
};
template <class V>
void visit_fields(V& v, SceneRegionCfg& c) {
  v.object("SceneRegionCfg", "A level surface on which objects may be placed.");
  v("name", c.name, "Name of the region.").required();
  v("on", c.on,
    "Full name of the box geom whose top is the surface, or of a body: then its highest box.")
      .required();
  v("area", c.area,
    "Area for the origins of objects: min x, max x, min y, max y in the world; all 0: the whole "
    "surface.")
      .unit("m");
  v("target_area", c.target_area, "The same for the object that the task is about.").unit("m");
  v("text", c.text,
    "What the surface is called in instructions, such as ``desk in the study``; by default it is "
    "not mentioned.")
      .or_none();
}

struct SceneRobotCfg {
  std::array<double, 3> pos{};
  double yaw = 0;
  std::array<double, 2> pos_spread{};
  double yaw_spread = 0;
};
template <class V>
void visit_fields(V& v, SceneRobotCfg& c) {
  v.object("SceneRobotCfg", "Placement of the robot's base at the start of an episode.");
  v("pos", c.pos, "Position on the floor.").unit("m");
  v("yaw", c.yaw, "Rotation about the vertical, degrees.");
  v("pos_spread", c.pos_spread, "Half width of the uniform noise of x and y.")
      .unit("m")
      .at_least(0);
  v("yaw_spread", c.yaw_spread, "Half width of the uniform noise of the yaw, degrees.").at_least(0);
}

enum class VaryKind { kLight, kMaterial, kGeom, kBody };
constexpr std::array<std::string_view, 4> enum_names(VaryKind) {
  return {"light", "material", "geom", "body"};
}

struct SceneVaryCfg {
  NamedEnum<VaryKind> what;
  std::string pattern;
  std::array<double, 2> brightness{1, 1};
  double hue = 0;
  double saturation = 0;
  std::array<double, 3> tint{1, 1, 1};
  std::array<double, 3> pos{};
  double angle = 0;
  std::vector<std::string> textures;
  std::string shows;
  bool optional = false;
};
template <class V>
void visit_fields(V& v, SceneVaryCfg& c) {
  v.object("SceneVaryCfg",
           "Randomisation of lights, materials, geoms or bodies in every episode; all draws are "
           "uniform.");
  v("what", c.what,
    "Type of the elements: lights, materials, geoms (without a material) or bodies that do not "
    "move.")
      .required();
  v("pattern", c.pattern, "Regular expression that must match the whole full name of an element.")
      .required();
  v("brightness", c.brightness, "Minimum and maximum factor of the colour.").at_least(0);
  v("hue", c.hue, "Half width of the change of the hue, degrees.").within(0, 180);
  v("saturation", c.saturation, "Half width of the change of the saturation.").within(0, 1);
  v("tint", c.tint,
    "Factors of the red, green and blue of the colour. Lights that are 0 0 0 are off.")
      .at_least(0);
  v("pos", c.pos, "light, body: half widths of the displacement.").unit("m").at_least(0);
  v("angle", c.angle,
    "light: maximum change of its direction; body: half width of the rotation about the vertical, "
    "degrees.")
      .within(0, 90);
  v("textures", c.textures,
    "material: full names of the textures to choose from. Where there is a texture <name>_normals, "
    "it is the normal map.");
  v("shows", c.shows,
    "material: full name of the texture that it emits in physically based images, such as the view "
    "from a window.")
      .or_none();
  v("optional", c.optional,
    "Ignore the entry if nothing matches its pattern, which is an error otherwise. Entries that a "
    "scene inherits are optional.");
}

// Whether it changes the colour of what it names.
inline bool changes_colour(const SceneVaryCfg& c) {
  return c.brightness != std::array<double, 2>{1, 1} || c.hue > 0 || c.saturation > 0 ||
         c.tint != std::array<double, 3>{1, 1, 1};
}

struct SceneMoodCfg {
  std::string name;
  std::vector<SceneVaryCfg> vary;
};
template <class V>
void visit_fields(V& v, SceneMoodCfg& c) {
  v.object(
      "SceneMoodCfg",
      "A light mood: changes of lights, materials and geoms that belong together, such as those "
      "of daylight.");
  v("name", c.name, "Name of the mood.").required();
  v("vary", c.vary,
    "What differs from the model in this mood. The scene's own ``vary`` comes after it, and its "
    "colour factors multiply those of the mood.");
}

struct SceneSkyCfg {
  std::array<double, 3> top = scene::kSkyTop, bottom = scene::kSkyBottom;
};
template <class V>
void visit_fields(V& v, SceneSkyCfg& c) {
  v.object("SceneSkyCfg", "The colours of the sky.");
  v("top", c.top, "Colour at the zenith, rgb.").within(0, 1);
  v("bottom", c.bottom, "Colour at the nadir, rgb.").within(0, 1);
}

struct SceneHeadlightCfg {
  double ambient = 0.1, diffuse = 0.4, specular = 0.5;
};
template <class V>
void visit_fields(V& v, SceneHeadlightCfg& c) {
  v.object("SceneHeadlightCfg", "The grey light at the camera.");
  v("ambient", c.ambient, "Ambient intensity.").within(0, 1);
  v("diffuse", c.diffuse, "Diffuse intensity.").within(0, 1);
  v("specular", c.specular, "Specular intensity.").within(0, 1);
}

struct SceneFileCfg {
  std::string name;
  std::string description;
  std::string extends;
  std::string base;
  std::string generator;
  int house = 0;
  std::vector<std::pair<std::string, double>> parameters;
  std::vector<SceneEntityCfg> entities;
  std::vector<std::string> catalogue;
  int catalogue_count = -1;
  std::vector<SceneObjectCfg> objects;
  std::vector<SceneRegionCfg> regions;
  SceneRobotCfg robot;
  std::vector<SceneVaryCfg> vary;
  std::vector<SceneMoodCfg> moods;
  std::optional<SceneSkyCfg> sky;
  std::optional<SceneHeadlightCfg> headlight;
  scene::OptionsCfg options;
  std::optional<double> extent;
  std::array<double, 2> sizes{1, 1};
  double gap = 0.02, target_gap = 0.07;
  double drop = 0.0003;
  std::array<int, 2> count{-1, -1};
  // Function that creates the models; replaces `base` and `entities`. Called for every compilation.
  std::function<scene::SceneCfg()> models;
};
template <class V>
void visit_fields(V& v, SceneFileCfg& c) {
  v.object("SceneFileCfg",
           "The scene of an episode: its models, its objects, where the objects may be placed, and "
           "what is randomised.");
  v("name", c.name, "Name of the scene.").required();
  v("description", c.description, "Description in one sentence.");
  v("extends", c.extends,
    "A scene, by name or file, that provides the values that this file does not set. Lists replace "
    "those of the base, except ``vary``.")
      .or_none();
  v("base", c.base,
    "An MJCF file, next to this file, that the scene starts from unchanged: its names get no "
    "prefix.")
      .or_none();
  v("generator", c.generator, "Generator of the first entity, ``room``, and of what belongs to it.")
      .or_none();
  v("house", c.house, "Number of the generated house; ``<scene>:7`` is house 7 of a scene.")
      .at_least(0);
  v("parameters", c.parameters, "Parameters of the generator, by name.");
  v("entities", c.entities, "The models, in this order.");
  v("catalogue", c.catalogue,
    "Objects of ``mjsense objects`` that the scene contains, by name or as regular expressions; "
    "each "
    "adds an entity and an object.");
  v("catalogue_count", c.catalogue_count,
    "Number of objects taken from ``catalogue``, in addition to its receptacles; each house number "
    "takes other ones. -1: all.")
      .at_least(-1);
  v("objects", c.objects,
    "Bodies that a task may use; empty: all graspable bodies with a free joint.");
  v("regions", c.regions,
    "Where objects may be placed; empty: objects stay where their models put them.");
  v("robot", c.robot, "Placement of the robot.");
  v("vary", c.vary,
    "What is randomised in every episode. The entries of a scene with ``extends`` follow those of "
    "its base; ``vary = []`` removes the base's.");
  v("moods", c.moods,
    "Light moods; every episode uses one of them, all with the same probability.");
  v("sky", c.sky,
    "Colours of the sky; by default a generated scene has a blue sky outside its windows.");
  v("headlight", c.headlight, "The light at the camera; by default MuJoCo's.");
  v("options", c.options, "Physics options.");
  v("extent", c.extent, "Value that replaces ``stat.extent`` of the model.").unit("m").positive();
  v("sizes", c.sizes,
    "Minimum and maximum scale of the objects; an episode uses one of six evenly spaced scales.")
      .within(0.1, 10);
  v("gap", c.gap, "Minimum distance between two objects.").unit("m").at_least(0);
  v("target_gap", c.target_gap,
    "Minimum distance between the object that the task is about and the others.")
      .unit("m")
      .at_least(0);
  v("drop", c.drop, "Height above the surface at which objects start.").unit("m").at_least(0);
  v("count", c.count,
    "Minimum and maximum number of objects that are present, the target included; -1: all. The "
    "others are absent.");
  v.python("models", "Callable[[], SceneCfg] | None", "None",
           "Function that makes the models, instead of ``base`` and ``entities``.");
}

// Checks relations between the fields. Throws ValueError.
void validate(const SceneFileCfg& cfg, std::string_view context);

}  // namespace mjsense::tasks::scenes
