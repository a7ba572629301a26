#include "tools/study_pool.h"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "tools/progress.h"
#include "tools/signals.h"
#include "tools/study_member.h"
#include "tools/study_process.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;

class Pool {
 public:
  Pool(const StudyPlan& plan, const StudyStore& store, const std::set<std::size_t>& selection,
       const PoolOptions& options)
      : plan_(plan), store_(store), options_(options) {
    std::set<std::string> seen;
    for (const std::size_t index : selection)
      if (seen.insert(plan.members[index].id).second) waiting_.push_back(index);
  }

  PoolResult run() {
    drop_what_is_there();
    total_ = waiting_.size();
    const StopSignals signals;
    int told = 0;
    while (!waiting_.empty() || !running_.empty()) {
      if (signals.received() != 0 && told == 0) {
        told = signals.received();
        result_.stopped = true;
        note(options_.globals, "stopping: every member closes its log first");
        for (const auto& [task, started] : running_) signal_task(task, SIGTERM);
      }
      const bool may_start = !result_.stopped && !result_.output_failed;
      bool moved = collect();
      if (may_start) moved = start_ready() || moved;
      if (running_.empty() && !moved) break;
      if (!moved) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    store_.write_results();
    store_.tidy();
    return result_;
  }

 private:
  struct Started {
    std::size_t index = 0;
    std::chrono::steady_clock::time_point when;
  };

  /// What is done needs no process, unless a fork that is not done needs its log.
  void drop_what_is_there() {
    std::set<std::string> unfinished, wanted;
    for (const std::size_t index : waiting_)
      if (const MemberState state = store_.state_of(plan_.members[index]);
          state != MemberState::done && state != MemberState::failed)
        unfinished.insert(plan_.members[index].id);
    // From forks to their parents, in as many passes as there are generations.
    for (bool more = true; more;) {
      more = false;
      for (const std::size_t index : waiting_) {
        const StudyMember& member = plan_.members[index];
        if (!member.parent || unfinished.count(member.id) == 0) continue;
        const StudyMember& parent = plan_.members[*member.parent];
        if (unfinished.count(parent.id) > 0) continue;
        const auto row = store_.read_row(parent.id);
        if (!row || row->failed || store_.has_log(parent, *row)) continue;
        store_.forget(parent.id);
        more = unfinished.insert(parent.id).second;
      }
    }
    std::vector<std::size_t> left;
    for (const std::size_t index : waiting_) {
      const std::string& id = plan_.members[index].id;
      if (unfinished.count(id) > 0) {
        left.push_back(index);
        continue;
      }
      const auto row = store_.read_row(id);
      ++(row && row->failed ? result_.failed : result_.skipped);
    }
    waiting_ = std::move(left);
  }

  enum class Readiness { ready, later, never };
  Readiness readiness(const StudyMember& member) const {
    if (!member.parent) return Readiness::ready;
    const std::string& parent = plan_.members[*member.parent].id;
    for (const std::size_t index : waiting_)
      if (plan_.members[index].id == parent) return Readiness::later;
    for (const auto& [task, started] : running_)
      if (plan_.members[started.index].id == parent) return Readiness::later;
    const auto row = store_.read_row(parent);
    return row && !row->failed ? Readiness::ready : Readiness::never;
  }

  bool start_ready() {
    bool moved = false;
    for (std::size_t i = 0; i < waiting_.size() && running_.size() < options_.jobs;) {
      const std::size_t index = waiting_[i];
      const StudyMember& member = plan_.members[index];
      const Readiness ready = readiness(member);
      if (ready == Readiness::later) {
        ++i;
        continue;
      }
      waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(i));
      moved = true;
      if (ready == Readiness::never) {
        fail_orphan(member);
        continue;
      }
      const pid_t task = start_task(
          [this, &member] { return execute_member(plan_, store_, member, options_.threads); });
      running_[task] = {index, std::chrono::steady_clock::now()};
    }
    return moved;
  }

  /// A fork whose parent failed: a row of its own that says so.
  void fail_orphan(const StudyMember& member) {
    const auto parent = store_.read_row(plan_.members[*member.parent].id);
    if (!parent || !parent->failed) {  // it was interrupted: the fork waits with it
      ++result_.interrupted;
      return;
    }
    StudyRow row;
    row.id = member.id;
    row.failed = true;
    row.code = exit_usage;
    row.error = "its parent failed: " + parent->error;
    fs::create_directories(store_.member_folder(member.id));
    store_.write_row(row);
    report(member, exit_study, 0);
  }

  bool collect() {
    bool moved = false;
    for (auto each = running_.begin(); each != running_.end();) {
      const int code = poll_task(each->first);
      if (code < 0) {
        ++each;
        continue;
      }
      const Started started = each->second;
      each = running_.erase(each);
      moved = true;
      const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - started.when;
      report(plan_.members[started.index], code, wall.count());
    }
    if (moved) {
      store_.write_results();
      store_.tidy();
    }
    return moved;
  }

  void report(const StudyMember& member, int code, double wall) {
    std::string how = fmt::format("{:.1f} s", wall);
    if (code == exit_ok) {
      ++result_.done;
    } else if (code == exit_study) {
      ++result_.failed;
      const auto row = store_.read_row(member.id);
      how = "failed: " + (row ? row->error : std::string());
    } else if (code == exit_output) {
      result_.output_failed = true;
      how = "output could not be written";
    } else {
      ++result_.interrupted;
      how = code == exit_stopped ? "stopped" : fmt::format("ended with {}", code);
    }
    ++ended_;
    note(options_.globals, fmt::format("[{}/{}] {}: {}", ended_, total_, label_of(plan_, member),
                                       how));
  }

  const StudyPlan& plan_;
  const StudyStore& store_;
  const PoolOptions& options_;
  std::vector<std::size_t> waiting_;
  std::map<pid_t, Started> running_;
  PoolResult result_;
  std::size_t total_ = 0, ended_ = 0;
};

}  // namespace

PoolResult run_members(const StudyPlan& plan, const StudyStore& store,
                       const std::set<std::size_t>& selection, const PoolOptions& options) {
  return Pool(plan, store, selection, options).run();
}

}  // namespace varve::tools
