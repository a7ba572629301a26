// The front door and what all verbs share.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/errors.h"
#include "tests/tools/process.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

using test::bin_folder;
using test::run_command;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Runs verb_main() in this process, with options of every kind.
int run_verb(std::vector<std::string> words, const std::function<int(const Invocation&)>& body,
             std::size_t arguments_max = 2) {
  Verb verb;
  verb.name = "probe";
  verb.usage = "A B";
  verb.summary = "a verb for tests";
  verb.options = {{"threads,t", "N", "a number", false, "4"},
                  {"set,s", "KEY=VALUE", "repeatable", true, ""},
                  {"force", "", "a flag", false, ""},
                  {"at", "STEP", "no default", false, ""}};
  verb.arguments_max = arguments_max;
  verb.run = body;
  words.insert(words.begin(), "varve-probe");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  return verb_main(static_cast<int>(argv.size()), argv.data(), verb);
}

/// The same, returning what was printed on standard error.
std::string errors_of(const std::vector<std::string>& words,
                      const std::function<int(const Invocation&)>& body =
                          [](const Invocation&) { return 0; }) {
  ::testing::internal::CaptureStderr();
  run_verb(words, body);
  return ::testing::internal::GetCapturedStderr();
}

TEST(CommandLine, OptionsOfEveryKind) {
  const int code = run_verb(
      {"one", "-t", "2", "--set", "a=1", "--force", "-sb=2", "two", "-v", "-v", "--at=-5", "-q"},
      [](const Invocation& invocation) {
        EXPECT_EQ(invocation.arguments, (std::vector<std::string>{"one", "two"}));
        EXPECT_EQ(invocation.value("threads"), "2");
        EXPECT_EQ(invocation.count("threads"), 2u);
        EXPECT_EQ(invocation.values("set"), (std::vector<std::string>{"a=1", "b=2"}));
        EXPECT_TRUE(invocation.has("force"));
        EXPECT_EQ(invocation.number("at"), -5.0);
        EXPECT_EQ(invocation.globals.verbosity, 2);
        EXPECT_TRUE(invocation.globals.quiet);
        EXPECT_FALSE(invocation.globals.json);
        return 17;
      });
  EXPECT_EQ(code, 17);
}

TEST(CommandLine, DefaultsAndAbsence) {
  run_verb({}, [](const Invocation& invocation) {
    EXPECT_EQ(invocation.value("threads"), "4");
    EXPECT_FALSE(invocation.has("threads"));
    EXPECT_TRUE(invocation.values("set").empty());
    EXPECT_EQ(invocation.count("at"), std::nullopt);
    EXPECT_THROW((void)invocation.value("at"), UsageError);
    return 0;
  });
}

TEST(CommandLine, NumbersAreChecked) {
  EXPECT_EQ(errors_of({"-t", "many"},
                      [](const Invocation& i) { return static_cast<int>(*i.count("threads")); }),
            "varve probe: --threads: expected a whole number, got 'many'\n");
  EXPECT_EQ(errors_of({"-t", "-1"},
                      [](const Invocation& i) { return static_cast<int>(*i.count("threads")); }),
            "varve probe: --threads: expected a whole number, got '-1'\n");
  EXPECT_EQ(errors_of({"--at", "inf"},
                      [](const Invocation& i) { return static_cast<int>(*i.number("at")); }),
            "varve probe: --at: expected a number, got 'inf'\n");
}

TEST(CommandLine, WhatIsWrongIsNamed) {
  EXPECT_EQ(errors_of({"--treads", "2"}),
            "varve probe: unknown option '--treads'; did you mean '--threads'?\n");
  EXPECT_EQ(errors_of({"--thread", "2"}),
            "varve probe: unknown option '--thread'; did you mean '--threads'?\n");
  EXPECT_THAT(errors_of({"-x"}), HasSubstr("unknown option '-x'"));
  EXPECT_EQ(errors_of({"--threads"}),
            "varve probe: option '--threads': expected a value, got none\n");
  EXPECT_EQ(errors_of({"--force=1"}),
            "varve probe: option '--force': expected no value, got one\n");
  EXPECT_EQ(errors_of({"-t1", "-t2"}), "varve probe: option '--threads' was given twice\n");
  EXPECT_EQ(errors_of({"1", "2", "3"}), "varve probe: expected at most 2 arguments (A B), got 3\n");
  EXPECT_EQ(errors_of({"--color", "red"}),
            "varve probe: --color: expected one of auto, always, never, got 'red'\n");
  EXPECT_EQ(errors_of({"--progress", "x"}),
            "varve probe: --progress: expected one of auto, bar, lines, json, none, got 'x'\n");
  EXPECT_EQ(run_verb({"--treads"}, [](const Invocation&) { return 0; }), 2);
}

TEST(CommandLine, EndOfOptions) {
  run_verb({"--", "--force", "-x"}, [](const Invocation& invocation) {
    EXPECT_EQ(invocation.arguments, (std::vector<std::string>{"--force", "-x"}));
    EXPECT_FALSE(invocation.has("force"));
    return 0;
  });
}

TEST(ExitCodes, EachFailureHasItsOwn) {
  const auto code_of = [](const std::function<int()>& failure) {
    ::testing::internal::CaptureStderr();
    const int code = run_verb({}, [&](const Invocation&) { return failure(); });
    EXPECT_THAT(::testing::internal::GetCapturedStderr(), StartsWith("varve probe: "));
    return code;
  };
  using io::ErrorKind;
  using io::LogError;
  EXPECT_EQ(code_of([]() -> int { throw UsageError("x"); }), 2);
  EXPECT_EQ(code_of([]() -> int { throw ToolError(exit_numerical, "x"); }), 5);
  const std::vector<std::pair<ErrorKind, int>> kinds{
      {ErrorKind::not_found, 2}, {ErrorKind::exists, 2},    {ErrorKind::locked, 2},
      {ErrorKind::unsupported, 2}, {ErrorKind::not_a_log, 4}, {ErrorKind::damaged, 4},
      {ErrorKind::limit, 4},     {ErrorKind::write_failed, 74}, {ErrorKind::mismatch, 2}};
  for (const auto& [kind, code] : kinds) {
    const ErrorKind thrown = kind;
    EXPECT_EQ(code_of([thrown]() -> int { throw LogError(thrown, "a.varve", "x", 7); }), code);
  }
  EXPECT_EQ(code_of([]() -> int { throw std::bad_alloc(); }), 70);
  EXPECT_EQ(code_of([]() -> int { throw std::logic_error("x"); }), 70);
  EXPECT_EQ(run_verb({}, [](const Invocation&) -> int { throw Exit{3}; }), 3);
}

TEST(Names, NearestIsNear) {
  const std::vector<std::string_view> names{"run", "resume", "replay", "recover", "fork"};
  EXPECT_EQ(nearest_name("replya", names), "replay");
  EXPECT_EQ(nearest_name("ruN", names), "run");
  EXPECT_EQ(nearest_name("spoon", names), "");
  EXPECT_EQ(nearest_name("", names), "");
  EXPECT_EQ(nearest_name(std::string(1000, 'x'), names), "");
}

TEST(Color, FollowsFlagEnvironmentAndTerminal) {
  Globals globals;
  EXPECT_FALSE(use_color(globals, false));  // a test's output is no terminal
  globals.color = ColorMode::always;
  EXPECT_TRUE(use_color(globals, false));
  EXPECT_EQ(bold(globals, "x"), "\x1b[1mx\x1b[0m");
  globals.color = ColorMode::never;
  EXPECT_EQ(bold(globals, "x"), "x");
}

TEST(FrontDoor, RunsTheVerbBesideIt) {
  const auto direct = run_command({"varve-check", "column", "--json"});
  const auto through = run_command({"varve", "check", "column", "--json"});
  EXPECT_EQ(through.code, 0);
  EXPECT_EQ(through.output, direct.output);
  EXPECT_EQ(run_command({"varve", "check", "no_such.cfg"}).code, 2);
  EXPECT_EQ(run_command({"varve", "check", "column", "-s", "x=1"}).code, 3);
}

TEST(FrontDoor, CopiedFolderWorksFromAnywhere) {
  const test::TemporaryFolder folder;
  for (const char* name : {"varve", "varve-init"})
    std::filesystem::copy_file(bin_folder() + "/" + name, folder / name);
  const auto result = run_command({folder / "varve", "init"}, {"/", {}, ""});
  EXPECT_EQ(result.code, 0) << result.errors;
  EXPECT_THAT(result.output, HasSubstr("[domain]"));
  EXPECT_EQ(run_command({folder / "varve", "check", "column"}).code, 2);
  const std::string help = run_command({folder / "varve", "--help"}).output;
  EXPECT_THAT(help, HasSubstr("  init "));
  EXPECT_THAT(help, ::testing::Not(HasSubstr("  check ")));
}

TEST(FrontDoor, Help) {
  const auto help = run_command({"varve", "--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_EQ(help.errors, "");
  EXPECT_THAT(help.output, HasSubstr("usage: varve VERB"));
  EXPECT_THAT(help.output, HasSubstr("  check "));
  EXPECT_EQ(run_command({"varve", "help"}).output, help.output);
  EXPECT_EQ(run_command({"varve", "help", "init"}).output,
            run_command({"varve", "init", "--help"}).output);
  const auto bare = run_command({"varve"});
  EXPECT_EQ(bare.code, 2);
  EXPECT_EQ(bare.output, "");
  EXPECT_EQ(bare.errors, help.output);
}

TEST(FrontDoor, UnknownVerbs) {
  EXPECT_EQ(run_command({"varve", "chekc"}).errors,
            "varve: expected a verb, got 'chekc'; did you mean 'check'?\n");
  EXPECT_EQ(run_command({"varve", "chekc"}).code, 2);
  EXPECT_EQ(run_command({"varve", "dance"}).errors,
            "varve: expected a verb, got 'dance'; varve --help lists them\n");
  EXPECT_EQ(run_command({"varve", "../bin/varve-init"}).code, 2);
  EXPECT_EQ(run_command({"varve", "--nothing"}).code, 2);
  EXPECT_EQ(run_command({"varve", ""}).code, 2);
}

TEST(EveryVerb, AnswersHelpAndVersion) {
  std::size_t verbs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(bin_folder())) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("varve-")) continue;
    ++verbs;
    const auto help = run_command({name, "--help"});
    EXPECT_EQ(help.code, 0) << name;
    EXPECT_EQ(help.errors, "") << name;
    EXPECT_THAT(help.output, StartsWith("usage: varve " + name.substr(6) + " "));
    EXPECT_THAT(help.output, HasSubstr("\n  varve " + name.substr(6))) << "an example is missing";
    EXPECT_THAT(help.output, HasSubstr("--progress HOW"));
    EXPECT_EQ(run_command({name, "-h"}).output, help.output);
    const auto version = run_command({name, "--version"});
    EXPECT_EQ(version.code, 0) << name;
    EXPECT_THAT(version.output, StartsWith("varve 0."));
    const auto unknown = run_command({name, "--no-such-option"});
    EXPECT_EQ(unknown.code, 2) << name;
    EXPECT_THAT(unknown.errors, StartsWith("varve " + name.substr(6) + ": unknown option"));
  }
  EXPECT_GE(verbs, 2u);
}

TEST(Pipes, AReaderThatHasHadEnoughIsNoFailure) {
  const auto result = run_command(
      {"/bin/bash", "-c",
       "set -o pipefail; " + bin_folder() + "/varve-init --all | head -c 10 > /dev/null"});
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(result.errors, "");
  // Many times the size of a pipe, to a reader that is gone before anything is written.
  const auto late = run_command(
      {"/bin/bash", "-c",
       "set -o pipefail; (sleep 0.2; " + bin_folder() + "/varve-init --all) | true"});
  EXPECT_EQ(late.code, 0);
  EXPECT_EQ(late.errors, "");
}

TEST(Pipes, AFullDiskIsAFailure) {
  const auto result =
      run_command({"/bin/sh", "-c", bin_folder() + "/varve-init --all > /dev/full"});
  EXPECT_EQ(result.code, 74);
  EXPECT_EQ(result.errors,
            "varve init: standard output: could not be written: No space left on device\n");
}

}  // namespace
}  // namespace varve::tools
