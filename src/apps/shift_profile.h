#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <sgf/apps/window_cost.h>

namespace sgf::apps {

/// A toy image: a strip of large boxes side by side, whose left to right borders are the edges that
/// a horizontal line through their middle meets, between rows of small boxes that are alternately
/// dark and bright. The defaults have, along the line, a strong edge, a weak one of inverted
/// contrast, the reference, one of a third of its strength, and a strong one of inverted contrast.
struct ToyOptions {
  std::vector<double> levels{40, 170, 134, 170, 182, 40};
  int reference_edge = 2;
  int box_width = 40;
  int box_height = 48;
  int small_box = 8;
  int small_rows = 3;
  std::vector<double> small_levels{20, 210};
  double blur = 1.5;

  template <class V>
  void VisitFields(V&& visit) {
    visit("levels", levels, "grey levels", "the large boxes, from left to right");
    visit("reference_edge", reference_edge, "", "edge that is searched; 0: between boxes 0 and 1");
    visit("box_width", box_width, "px", "width of a large box");
    visit("box_height", box_height, "px", "height of a large box");
    visit("small_box", small_box, "px", "side of a small box");
    visit("small_rows", small_rows, "", "rows of small boxes above the large ones, and below");
    visit("small_levels", small_levels, "grey levels", "the small boxes, in turn");
    visit("blur", blur, "px", "standard deviation of the blur of the whole image");
  }
};

struct Toy {
  cv::Mat1b image;
  cv::Point reference;     ///< pixel right of the reference edge, on the line
  std::vector<int> edges;  ///< shifts that move the reference edge onto each edge, px
};

/// @throws Error naming the option that is out of range.
Toy MakeToy(const ToyOptions& options);

/// How errors are taken along the line and what counts as a minimum.
struct ProfileOptions {
  std::vector<std::string> metrics{"ugf", "mag", "sgf", "photo"};
  SampleOptions samples;
  stereo::PmOptions pm;
  int patch_width = 11;
  int patch_height = 41;
  double minimum_share = 0.25;
  int minimum_distance = 5;

  template <class V>
  void VisitFields(V&& visit) {
    visit("metrics", metrics, "", "dissimilarities, names of the table");
    visit("samples", samples, "", "gradients and their normalisation");
    visit("pm", pm, "", "parameters of pm, eq. 4");
    visit("patch_width", patch_width, "px", "of the patch around the reference, odd");
    visit("patch_height", patch_height, "px", "of the patch around the reference, odd");
    visit("minimum_share", minimum_share, "",
          "a minimum lies below least + this * (median - least) of the profile");
    visit("minimum_distance", minimum_distance, "px",
          "a minimum is the least error within this distance");
  }
};

/// Error of a patch against the one shifted by first, first + 1, ... px.
struct Profile {
  int first = 0;
  std::vector<double> errors;  ///< mean over the patch; the dissimilarity's own value if windowed
};

/// Compares the patch of `reference` around `centre` with those of `image` on the same line,
/// wherever they are a pixel away from the border.
/// @throws Error for an unknown or unfit dissimilarity or a patch that does not fit.
Profile ShiftPatch(const SampleField& reference, const SampleField& image, cv::Point centre,
                   const std::string& metric, const ProfileOptions& options);

struct Minimum {
  int shift;  ///< px
  double error;
};

/// The minima of a profile, from left to right: least within `minimum_distance` (the first of
/// equals; never the ends of the profile) and deep enough (see `minimum_share`).
std::vector<Minimum> FindMinima(const Profile& profile, const ProfileOptions& options);

/// The study as its file describes it.
struct ShiftStudy {
  ToyOptions toy;
  ProfileOptions profile;
  double noise = 1.5;
  int seed = 1;

  template <class V>
  void VisitFields(V&& visit) {
    visit("toy", toy, "", "the image");
    visit("profile", profile, "", "patch, dissimilarities and minima");
    visit("noise", noise, "grey levels", "standard deviation of the noise in the noisy row");
    visit("seed", seed, "", "chooses the noise");
  }
};

/// Reads the study under the key `study` of an experiment's file.
/// @throws Error naming the file and what is wrong in it.
ShiftStudy ReadShiftStudy(const std::string& file);

/// One row of the figure.
struct ShiftRow {
  cv::Mat1b image;                ///< the one that is searched
  SampleField samples;            ///< its samples
  std::vector<Profile> profiles;  ///< one per dissimilarity of the study
};

/// Shifts the reference patch of the toy over the toy. With noise, the two have noise of their own,
/// as two photographs have.
/// @param noise standard deviation, grey levels.
ShiftRow MakeShiftRow(const ShiftStudy& study, const Toy& toy, double noise);

/// What `sgf_study shift-profile` is asked for.
struct ShiftProfileRequest {
  std::string experiment;  ///< YAML file of the study
  std::string output;      ///< folder
};

/// Runs the study, rows noise_free and noisy. Writes profiles.csv, minima.csv, edges.csv and per
/// row the image searched (<row>.png) and its normalised gradient (<row>_ax.pfm, <row>_ay.pfm).
/// @throws Error for a file, name or option that is not as it should be.
void RunShiftProfile(const ShiftProfileRequest& request);

}  // namespace sgf::apps
