#include "tools/study_slurm.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t tasks_max = 1000;  // Slurm's own limit is 1001 unless it is raised

/// One word for the shell, whatever is in it.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

std::size_t generation_of(const StudyPlan& plan, std::size_t index) {
  std::size_t generation = 0;
  while (plan.members[index].parent) {
    index = *plan.members[index].parent;
    ++generation;
  }
  return generation;
}

std::string command_of(const StudyPlan& plan, const StudyStore& store, const std::string& action,
                       const SlurmOptions& options) {
  return fmt::format("{} {} {} --folder {}", quoted(options.program), action,
                     quoted(fs::absolute(plan.file.path).lexically_normal().string()),
                     quoted(fs::absolute(store.folder()).lexically_normal().string()));
}

/// One task of the array is one member. A signal before the time is up lets the member close its
/// log; it exits with 75 and is queued again.
std::string array_script(const StudyPlan& plan, const StudyStore& store,
                         const SlurmOptions& options, std::size_t generation, std::size_t first,
                         std::size_t count) {
  return fmt::format(
      "#!/bin/bash\n"
      "#SBATCH --job-name=varve-{0}-{1}\n"
      "#SBATCH --array=0-{2}\n"
      "#SBATCH --ntasks=1 --cpus-per-task={3}\n"
      "#SBATCH --output=%x-%A_%a.out --open-mode=append --requeue --signal=B:TERM@60\n"
      "set -u\n"
      "id=$(sed -n \"$((SLURM_ARRAY_TASK_ID + {4} + 1))p\" {5})\n"
      "{6} --member \"$id\" --threads {3} --progress none &\n"
      "p=$!\n"
      "trap 'kill -TERM $p' TERM USR1\n"
      "while :; do\n"
      "  wait $p\n"
      "  rc=$?\n"
      "  kill -0 $p 2>/dev/null || break\n"
      "done\n"
      "[ $rc = 75 ] && scontrol requeue \"${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}\"\n"
      "exit $rc\n",
      plan.file.name, generation, count - 1, options.threads, first,
      quoted(fs::absolute(store.path(fmt::format("slurm/tasks-{}.txt", generation)))
                 .lexically_normal()
                 .string()),
      command_of(plan, store, "run", options));
}

void make_executable(const std::string& path) {
  std::error_code ignored;
  fs::permissions(path, fs::perms::owner_exec | fs::perms::group_exec | fs::perms::others_exec,
                  fs::perm_options::add, ignored);
}

}  // namespace

std::vector<std::string> write_slurm_scripts(const StudyPlan& plan, const StudyStore& store,
                                             const std::set<std::size_t>& selection,
                                             const SlurmOptions& options) {
  std::vector<std::vector<std::string>> generations;
  std::set<std::string> seen;
  for (const std::size_t index : selection) {
    const StudyMember& member = plan.members[index];
    if (!seen.insert(member.id).second) continue;
    const MemberState state = store.state_of(member);
    if (state == MemberState::done || state == MemberState::failed) continue;
    const std::size_t generation = generation_of(plan, index);
    if (generations.size() <= generation) generations.resize(generation + 1);
    generations[generation].push_back(member.id);
  }
  std::vector<std::string> paths;
  if (generations.empty()) return paths;
  std::error_code failed;
  fs::create_directories(store.path("slurm"), failed);
  if (failed)
    throw ToolError(exit_output, fmt::format("{}: {}", store.path("slurm"), failed.message()));

  std::string submit =
      "#!/bin/bash\n# Runs first, then their forks, then the report.\nset -eu\n"
      "cd \"$(dirname \"$0\")\"\nafter=\n";
  for (std::size_t g = 0; g < generations.size(); ++g) {
    const std::vector<std::string>& ids = generations[g];
    if (ids.empty()) continue;
    write_whole(store.path(fmt::format("slurm/tasks-{}.txt", g)),
                fmt::format("{}\n", fmt::join(ids, "\n")));
    submit += "jobs=\n";
    for (std::size_t first = 0; first < ids.size(); first += tasks_max) {
      const std::string name = fmt::format("array-{}-{}.sh", g, first / tasks_max);
      paths.push_back(store.path("slurm/" + name));
      write_whole(paths.back(), array_script(plan, store, options, g, first,
                                             std::min(tasks_max, ids.size() - first)));
      make_executable(paths.back());
      submit += fmt::format("jobs=$jobs:$(sbatch --parsable $after {})\n", name);
    }
    submit += "after=--dependency=afterany$jobs\n";
  }
  paths.push_back(store.path("slurm/collect.sh"));
  write_whole(paths.back(),
              fmt::format("#!/bin/bash\n#SBATCH --job-name=varve-{}-report\n"
                          "#SBATCH --ntasks=1 --output=%x-%j.out\nexec {}\n",
                          plan.file.name, command_of(plan, store, "report", options)));
  make_executable(paths.back());
  paths.push_back(store.path("slurm/submit.sh"));
  write_whole(paths.back(), submit + "sbatch --parsable $after collect.sh\n");
  make_executable(paths.back());
  return paths;
}

}  // namespace varve::tools
