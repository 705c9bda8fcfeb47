#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include <sgf/synth/patch.h>
#include <sgf/synth/texture.h>

namespace sgf::synth {

/// What a surface looks like.
struct Material {
  int texture = -1;                                ///< index in the scene; -1: plain
  Eigen::Vector3f tint = Eigen::Vector3f::Ones();  ///< multiplies the texture; plain albedo
  float tile_m = 1;                                ///< side of one texture image on the surface
  bool fit = false;      ///< one texture image over the whole patch instead (pictures, signs)
  float specular = 0;    ///< strength of the lamps' glossy highlight, 0 to 1
  float shininess = 50;  ///< Phong exponent of that highlight: 10 dull, 200 polished
  float mirror = 0;  ///< share of the mirrored surroundings at normal incidence, 0 to 1; rises to 1
                     ///< at grazing incidence where it is not 0 (Schlick)
};

/// Surfaces of one material.
struct Part {
  Patches patches;
  Material material;
};

/// A thing with an id of its own: its index in the scene plus 1.
struct Object {
  std::string name;
  std::vector<Part> parts;
};

/// A lamp: a parallelogram that shines to the side of edge_s x edge_t with the same radiance in all
/// directions. It is itself seen by cameras and mirrors unless hidden.
struct AreaLight {
  std::string group;                                   ///< lamps of one group are switched together
  Eigen::Vector3f corner, edge_s, edge_t;              ///< m
  Eigen::Vector3f radiance = Eigen::Vector3f::Ones();  ///< linear RGB
  bool hidden = false;                                 ///< shines without being seen
};

/// What rays see that hit nothing, and what it sends onto surfaces.
struct Sky {
  std::string group;
  Eigen::Vector3f zenith, horizon;  ///< radiance, linear RGB
};

/// A place to look from.
struct View {
  std::string name;
  Eigen::Vector3f eye, target;  ///< m
};

/// Everything that is rendered. World frame: z up, the floor near z = 0, metres.
/// Radiances are scaled so that white diffuse surfaces in full light send about 1.
struct Scene {
  std::string name;
  std::vector<Object> objects;
  std::vector<Texture> textures;
  std::vector<AreaLight> lights;
  std::optional<Sky> sky;
  std::vector<View> views;  ///< at least four good ones

  /// Adds a procedural texture and returns its index. @throws Error for an unknown name.
  int AddTexture(std::string_view name, int size_px = 512, uint32_t seed = 1);

  /// Adds an object of one material.
  void Add(std::string object_name, Patches patches, const Material& material);

  /// Adds an object of several parts.
  void Add(std::string object_name, std::vector<Part> parts);

  /// Names of the light groups, in order of first appearance.
  std::vector<std::string> LightGroups() const;
};

/// A scene's name and what it stands for.
struct SceneInfo {
  std::string_view name;
  std::string_view text;
  std::function<Scene()> build;
};

/// Every scene.
std::span<const SceneInfo> AllScenes();

/// Builds a scene. @throws Error listing the known names.
Scene BuildScene(std::string_view name);

// One file per scene under scenes/.
Scene LivingRoom();   ///< furnished; the stand-in for ICL-NUIM's living room
Scene MachineHall();  ///< pipes, tanks, racks; the stand-in for EuRoC's MH
Scene MocapRoom1();   ///< mattresses and boxes; the stand-in for EuRoC's V1
Scene MocapRoom2();   ///< the same room, furnished anew; the stand-in for EuRoC's V2
Scene Street();       ///< facades, parked cars, road; the stand-in for KITTI

}  // namespace sgf::synth
