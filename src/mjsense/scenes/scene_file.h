// SPDX-License-Identifier: Apache-2.0
#pragma once
// What an episode plays in, as data: models, the objects among them, where they may stand, where
// the robot stands, and what differs from episode to episode.

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/fields.h"
#include "mjsense/scene/daylight.h"
#include "mjsense/scene/options.h"
#include "mjsense/scene/scene.h"

namespace mjsense {

struct SceneEntityCfg {
  std::string name;
  std::string model;
  std::array<double, 3> pos{};
  std::array<double, 4> quat{1, 0, 0, 0};
  bool free = false;
  std::vector<std::string> without;
  std::optional<std::array<int, 2>> inertia_groups;
  int hidden_group = -1;
};
template <class V>
void visit_fields(V& v, SceneEntityCfg& c) {
  v.object("SceneEntityCfg", "A model of a scene; its names get the prefix ``<name>/``.");
  v("name", c.name, "Of the entity.").required();
  v("model", c.model,
    "An MJCF: a path, beside the scene's file, ``embedded:<file>``, or "
    "``package:<package>/<file>`` "
    "of an installed Python package.")
      .required();
  v("pos", c.pos, "Where it stands.").unit("m");
  v("quat", c.quat, "How it is turned, wxyz.");
  v("free", c.free,
    "Its body gets a free joint, which models of single objects often lack; a body without a name "
    "is called as the entity.");
  v("without", c.without,
    "Bodies that are left out, each with the whole tree in which it is: the robot of a model that "
    "has one.");
  v("inertia_groups", c.inertia_groups,
    "Groups of the geoms whose masses count, first and last, instead of what the model says.");
  v("hidden_group", c.hidden_group,
    "Geoms of this group are there to be touched and are not seen; -1: those of group 3 and up.")
      .within(-1, 5);
}

// How an object may rest: as its model has it, on its side (turned about y), on an end (about x).
inline constexpr std::array<std::string_view, 3> kRests{"upright", "side", "end"};

struct SceneObjectCfg {
  std::string body;
  std::string text;
  std::vector<std::string> other_texts;
  std::vector<std::string> rests{"upright"};
  bool receptacle = false;
  std::string color;
  std::optional<std::array<double, 2>> sizes;
};
template <class V>
void visit_fields(V& v, SceneObjectCfg& c) {
  v.object("SceneObjectCfg", "A body with a free joint that a task may be about.");
  v("body", c.body, "Full name in the scene, ``mug/mug``.").required();
  v("text", c.text, "What people call it; without it the last part of its name.").or_none();
  v("other_texts", c.other_texts, "What else they call it.");
  v("rests", c.rests, "How it may rest.").one_of(kRests).not_empty();
  v("receptacle", c.receptacle, "Things are put in or on it; it is not picked up itself.");
  v("color", c.color, "Of a receptacle: what tells it from others of its kind.").or_none();
  v("sizes", c.sizes, "Its own range of sizes, where the scene's does not suit it.")
      .within(0.1, 10);
}

struct SceneRegionCfg {
  std::string name;
  std::string on;
  std::array<double, 4> area{};
  std::optional<std::array<double, 4>> target_area;
};
template <class V>
void visit_fields(V& v, SceneRegionCfg& c) {
  v.object("SceneRegionCfg", "A level surface on which objects may stand.");
  v("name", c.name, "Of the region.").required();
  v("on", c.on, "Full name of the box geom whose top it is, or of a body: then its highest.")
      .required();
  v("area", c.area,
    "Where origins of objects may be: least x, most x, least y, most y in the world; all 0: the "
    "whole top.")
      .unit("m");
  v("target_area", c.target_area, "The same for the object that a task is about.").unit("m");
}

struct SceneRobotCfg {
  std::array<double, 3> pos{};
  double yaw = 0;
  std::array<double, 2> pos_spread{};
  double yaw_spread = 0;
};
template <class V>
void visit_fields(V& v, SceneRobotCfg& c) {
  v.object("SceneRobotCfg", "Where the robot's base stands at the start of an episode.");
  v("pos", c.pos, "On the floor.").unit("m");
  v("yaw", c.yaw, "About the vertical, degrees.");
  v("pos_spread", c.pos_spread, "Half width of uniform noise in x and y.").unit("m").at_least(0);
  v("yaw_spread", c.yaw_spread, "Half width of uniform noise, degrees.").at_least(0);
}

enum class VaryKind { kLight, kMaterial, kGeom, kBody };
template <>
inline constexpr std::array<std::string_view, 4> kWords<VaryKind>{"light", "material", "geom",
                                                                  "body"};

struct SceneVaryCfg {
  Word<VaryKind> what;
  std::string pattern;
  std::array<double, 2> brightness{1, 1};
  double hue = 0;
  double saturation = 0;
  std::array<double, 3> pos{};
  double angle = 0;
  std::vector<std::string> textures;
};
template <class V>
void visit_fields(V& v, SceneVaryCfg& c) {
  v.object("SceneVaryCfg", "What is different in every episode; all draws are uniform.");
  v("what", c.what, "Lights, materials, geoms (without a material) or bodies that do not move.")
      .required();
  v("pattern", c.pattern, "Regular expression that matches the whole full name of each.")
      .required();
  v("brightness", c.brightness, "Factor on the colour, least and most.").at_least(0);
  v("hue", c.hue, "Half width of a turn of the hue, degrees.").within(0, 180);
  v("saturation", c.saturation, "Half width of a shift of the saturation.").within(0, 1);
  v("pos", c.pos, "light, body: half widths of a move.").unit("m").at_least(0);
  v("angle", c.angle,
    "light: most by which its direction turns, body: half width of a turn about the vertical, "
    "degrees.")
      .within(0, 90);
  v("textures", c.textures, "material: full names of textures, one of which it has.");
}

struct SceneSkyCfg {
  std::array<double, 3> top = kSkyTop, bottom = kSkyBottom;
};
template <class V>
void visit_fields(V& v, SceneSkyCfg& c) {
  v.object("SceneSkyCfg", "The colours around.");
  v("top", c.top, "Of the zenith, rgb.").within(0, 1);
  v("bottom", c.bottom, "Of the nadir, rgb.").within(0, 1);
}

struct SceneHeadlightCfg {
  double ambient = 0.1, diffuse = 0.4, specular = 0.5;
};
template <class V>
void visit_fields(V& v, SceneHeadlightCfg& c) {
  v.object("SceneHeadlightCfg", "The light at the camera, grey.");
  v("ambient", c.ambient, "From everywhere.").within(0, 1);
  v("diffuse", c.diffuse, "Scattered.").within(0, 1);
  v("specular", c.specular, "Mirrored.").within(0, 1);
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
  std::vector<SceneObjectCfg> objects;
  std::vector<SceneRegionCfg> regions;
  SceneRobotCfg robot;
  std::vector<SceneVaryCfg> vary;
  std::optional<SceneSkyCfg> sky;
  std::optional<SceneHeadlightCfg> headlight;
  OptionsCfg options;
  std::optional<double> extent;
  std::array<double, 2> sizes{1, 1};
  double gap = 0.02, target_gap = 0.07;
  double drop = 0.0003;
  std::array<int, 2> count{-1, -1};
  // Models made by code, in the place of `base` and `entities`; called whenever they are compiled.
  std::function<SceneCfg()> models;
};
template <class V>
void visit_fields(V& v, SceneFileCfg& c) {
  v.object("SceneFileCfg",
           "What an episode plays in: models, objects, where they may stand, and what differs.");
  v("name", c.name, "Of the scene.").required();
  v("description", c.description, "A sentence for people.");
  v("extends", c.extends,
    "A scene, by name or file, whose values it has where it does not say another.")
      .or_none();
  v("base", c.base, "An MJCF to start from, as it is, beside the file: names without a prefix.")
      .or_none();
  v("generator", c.generator,
    "What makes its first entity, ``room``, and what belongs to it: one house of a street.")
      .or_none();
  v("house", c.house, "Which of the generator's; ``<scene>:7`` is house 7 of a scene.").at_least(0);
  v("parameters", c.parameters, "Numbers for the generator, by its names.");
  v("entities", c.entities, "Its models, in this order.");
  v("objects", c.objects,
    "Bodies that a task may be about; none named: all that have a free joint and that a hand can "
    "hold.");
  v("regions", c.regions, "Where they may stand; none: where their models have them.");
  v("robot", c.robot, "Where the robot stands.");
  v("vary", c.vary, "What is different in every episode.");
  v("sky", c.sky,
    "The colours around; without it a generated scene has blue ones outside its windows.");
  v("headlight", c.headlight, "The light at the camera; without it MuJoCo's.");
  v("options", c.options, "Of the physics.");
  v("extent", c.extent, "``stat.extent`` of the model.").unit("m").positive();
  v("sizes", c.sizes,
    "Of each object in an episode, as a factor on its model's, least and most: one of six, "
    "evenly "
    "apart.")
      .within(0.1, 10);
  v("gap", c.gap, "Free between two objects.").unit("m").at_least(0);
  v("target_gap", c.target_gap, "Free around the object that a task is about.")
      .unit("m")
      .at_least(0);
  v("drop", c.drop, "Above the surface at the start.").unit("m").at_least(0);
  v("count", c.count,
    "Objects that are there, the target among them, least and most; -1: all. The others are "
    "absent.");
  v.python("models", "Callable[[], SceneCfg] | None", "None",
           "Makes the models, in the place of ``base`` and ``entities``.");
}

// What its fields say of each other. Throws ValueError.
void validate(const SceneFileCfg& cfg, std::string_view place);

}  // namespace mjsense
