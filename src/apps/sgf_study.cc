// The studies behind Figures 1 to 3, and that of patch tracking.

#include <sgf/apps/cli.h>
#include <sgf/apps/convergence.h>
#include <sgf/apps/self_match.h>
#include <sgf/apps/semi_dense.h>
#include <sgf/apps/shift_profile.h>

namespace sgf::apps {
namespace {

CLI::App* AddSelfMatch(CLI::App& app, SelfMatchRequest& request) {
  CLI::App* command = app.add_subcommand(
      "self-match", "match an image against modifications of itself, where every disparity is 0");
  command->add_option("--experiment", request.experiment, "YAML file of the study")->required();
  command->add_option("--image", request.image, "image to match (PNG, JPEG, PGM, PPM)")->required();
  command->add_option("--name", request.name, "what the table calls the image")->required();
  command->add_option("--out", request.output, "CSV file to write")->required();
  command->add_option("--maps", request.maps, "folder for images and error maps of the cases");
  command->add_option("--threads", request.threads, "threads; 0 for all cores")
      ->capture_default_str();
  return command;
}

CLI::App* AddShiftProfile(CLI::App& app, ShiftProfileRequest& request) {
  CLI::App* command = app.add_subcommand(
      "shift-profile", "error of a patch of a toy image shifted along a line, and its minima");
  command->add_option("--experiment", request.experiment, "YAML file of the study")->required();
  command->add_option("--out", request.output, "folder for tables and images (made if missing)")
      ->required();
  return command;
}

CLI::App* AddConvergence(CLI::App& app, ConvergenceRequest& request) {
  CLI::App* command = app.add_subcommand(
      "convergence", "track patches into changed copies of images, from starts off the true place");
  command->add_option("--experiment", request.experiment, "YAML file of the study")->required();
  command->add_option("--images", request.images, "images (PNG, JPEG, PGM, PPM)")->required();
  command->add_option("--out", request.output, "CSV file to write")->required();
  command->add_option("--threads", request.threads, "threads; 0 for all cores")
      ->capture_default_str();
  return command;
}

CLI::App* AddSemiDense(CLI::App& app, SemiDenseRequest& request) {
  CLI::App* command = app.add_subcommand(
      "semi-dense", "reconstruct a known scene at its edges by patch search along the rows");
  command->add_option("--experiment", request.experiment, "YAML file of the study")->required();
  command->add_option("--pair", request.pair, "folder of a pair in Middlebury's layout")
      ->required();
  command->add_option("--out", request.output, "folder for points and scores (made if missing)")
      ->required();
  command->add_option("--threads", request.threads, "threads; 0 for all cores")
      ->capture_default_str();
  return command;
}

}  // namespace
}  // namespace sgf::apps

int main(int argc, char** argv) {
  using namespace sgf;
  CLI::App app(
      "Runs the studies behind Figures 1 to 3 and that of patch tracking, and writes their "
      "numbers.",
      "sgf_study");
  app.require_subcommand(1);
  apps::SelfMatchRequest self_match_request;
  apps::ShiftProfileRequest shift_profile_request;
  apps::SemiDenseRequest semi_dense_request;
  apps::ConvergenceRequest convergence_request;
  const CLI::App* self_match = apps::AddSelfMatch(app, self_match_request);
  const CLI::App* shift_profile = apps::AddShiftProfile(app, shift_profile_request);
  const CLI::App* semi_dense = apps::AddSemiDense(app, semi_dense_request);
  const CLI::App* convergence = apps::AddConvergence(app, convergence_request);

  return apps::RunTool(app, argc, argv, [&] {
    if (*self_match) apps::RunSelfMatch(self_match_request);
    if (*shift_profile) apps::RunShiftProfile(shift_profile_request);
    if (*semi_dense) apps::RunSemiDense(semi_dense_request);
    if (*convergence) apps::RunConvergence(convergence_request);
  });
}
