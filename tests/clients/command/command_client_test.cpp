#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "clients/command/command_program.h"
#include "idl/types/messages/run.h"
#include "tests/idl/wire/peer.h"

namespace tenon::command {
namespace {

/// A server of session "test" in a process of its own, in its life `epoch`. It gives everybody a seat. It is
/// killed by the first command, or answers them.
void runServer(std::uint32_t domain, std::uint32_t epoch, bool answers) {
  auto participant = test::participant(domain);
  wire::Partition lobby(participant, wire::kLobby);
  wire::Partition session(participant, wire::sessionPartition("test"));
  auto announces = wire::Writer<SessionAnnounce>::open(lobby, wire::kSessionAnnounce);
  auto welcomes = wire::Writer<Welcome>::open(lobby, wire::kWelcome);
  auto acks = wire::Writer<CommandAck>::open(session, wire::kCommandAck);
  auto runs = wire::Writer<RunState>::open(session, wire::kRunState);
  if (!announces || !welcomes || !acks || !runs) _exit(1);
  if (!announces->write({.session = "test", .server_epoch = epoch})) _exit(1);
  wire::Inbox inbox;
  auto heard = inbox.on<Join>(lobby, wire::kJoin, [&](const Join& join) {
    (void)welcomes->write({.client_guid = join.client_guid,
                           .session = join.session,
                           .server_epoch = epoch,
                           .accepted = true,
                           .client = ClientId{1}});
  });
  if (heard) {
    heard = inbox.on<Command>(session, wire::kCommand, [&](const Command& command) {
      if (!answers) _exit(0);
      (void)acks->write({command.client, command.id, true, {}, Refusal::kNone});
    });
  }
  if (!heard) _exit(1);
  while (true) inbox.dispatch(std::chrono::seconds(1));
}

/// A server that is stopped, and answers whether a clear names its newest raise.
void runStoppedServer(std::uint32_t domain) {
  auto participant = test::participant(domain);
  wire::Partition lobby(participant, wire::kLobby);
  wire::Partition session(participant, wire::sessionPartition("test"));
  auto announces = wire::Writer<SessionAnnounce>::open(lobby, wire::kSessionAnnounce);
  auto welcomes = wire::Writer<Welcome>::open(lobby, wire::kWelcome);
  auto acks = wire::Writer<CommandAck>::open(session, wire::kCommandAck);
  auto runs = wire::Writer<RunState>::open(session, wire::kRunState);
  auto raises = wire::Writer<NewestRaise>::open(session, wire::kNewestRaise);
  if (!announces || !welcomes || !acks || !runs || !raises) _exit(1);
  (void)raises->write({.number = 7, .standing = 3, .who = "Ben", .reason = "caught"});
  (void)runs->write({.phase = RunPhase::kStopped, .tick = 1, .reason = "after the raise"});
  (void)announces->write({.session = "test", .server_epoch = 7});
  wire::Inbox inbox;
  auto heard = inbox.on<Join>(lobby, wire::kJoin, [&](const Join& join) {
    (void)welcomes->write({.client_guid = join.client_guid,
                           .session = join.session,
                           .server_epoch = 7,
                           .accepted = true,
                           .client = ClientId{1}});
  });
  if (heard) {
    heard = inbox.on<Command>(session, wire::kCommand, [&](const Command& command) {
      (void)acks->write({command.client, command.id, command.value == 7.0, "not named", Refusal::kNone});
    });
  }
  if (!heard) _exit(1);
  while (true) inbox.dispatch(std::chrono::seconds(1));
}

/// Sends a command to a server that is killed by it; another one resumes the session.
Result<void> sendOverAKill(CommandKind kind) {
  const std::uint32_t domain = test::ownDomain();
  int begin[2];
  EXPECT_EQ(pipe(begin), 0);
  const test::Peer killed([domain] { runServer(domain, 7, false); });
  const test::Peer next([domain, &begin] {
    char byte;
    if (read(begin[0], &byte, 1) == 1) runServer(domain, 8, true);
  });
  const std::atomic<bool> stop = false;
  auto client = CommandClient::open({.domain = domain, .timeout = std::chrono::seconds(60)}, stop);
  if (!client) return fail(client.error().what);
  EXPECT_EQ(write(begin[1], "b", 1), 1);
  return (*client)->send({.command = kind, .text = "Ada"}, stop);
}

TEST(CommandClient, AKickThatAKilledServerDidNotAnswerIsSentToTheOneThatResumes) {
  const auto sent = sendOverAKill(CommandKind::kKick);
  EXPECT_TRUE(sent) << sent.error().what;
}

TEST(CommandClient, WhatMayNotBeDoneTwiceIsNotRepeatedAndThePersonIsToldSo) {
  const auto sent = sendOverAKill(CommandKind::kSkipStep);
  ASSERT_FALSE(sent);
  EXPECT_THAT(sent.error().what, ::testing::HasSubstr("may have obeyed or not"));
}

TEST(CommandClient, OfTheRaisesThatStandTheNewestIsTold) {
  EXPECT_EQ(describe({.number = 7, .standing = 3, .who = "Ben", .reason = "caught\x1b[2J"}),
            "emergency stop by Ben: caught [2J, the newest of 3 raises");
  EXPECT_EQ(describe({.number = 7, .standing = 1, .who = "Ben"}), "emergency stop by Ben: ");
}

TEST(CommandClient, AClearNamesTheRaisesThatItsSenderHasHeardOf) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer server([domain] { runStoppedServer(domain); });
  const std::atomic<bool> stop = false;
  auto client = CommandClient::open({.domain = domain, .timeout = std::chrono::seconds(60)}, stop);
  ASSERT_TRUE(client) << client.error().what;
  std::string told;
  (*client)->report_raise = [&](const std::string& line) { told += line + "\n"; };
  auto sent = (*client)->send({.command = CommandKind::kClearEmergencyStop}, stop);
  EXPECT_TRUE(sent) << sent.error().what;
  EXPECT_EQ((*client)->toldRaise(), 7U);
  sent = (*client)->send({.command = CommandKind::kClearEmergencyStop, .value = 6.0}, stop);
  EXPECT_FALSE(sent) << "by one who was told of the sixth";
  EXPECT_THAT(told, ::testing::HasSubstr("emergency stop by Ben: caught, the newest of 3 raises\n"));
}

TEST(CommandClient, AClearShowsWhatItClearsAlsoWhenThatWasHeardWhileItConnected) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer server([domain] { runStoppedServer(domain); });
  const std::atomic<bool> stop = false;
  auto client = CommandClient::open({.domain = domain, .timeout = std::chrono::seconds(60)}, stop);
  ASSERT_TRUE(client) << client.error().what;
  // by then the raise, which was written before it, is here as well
  for (int i = 0; i < 3000 && !(*client)->isOver(); ++i) (*client)->dispatch(std::chrono::milliseconds(20));
  ASSERT_TRUE((*client)->isOver());
  EXPECT_EQ((*client)->toldRaise(), 0U) << "nobody was there to be told";
  testing::internal::CaptureStdout();
  EXPECT_EQ(commandOnce(**client, {"clear"}, stop), 0);
  EXPECT_EQ(testing::internal::GetCapturedStdout(),
            "emergency stop by Ben: caught, the newest of 3 raises\nclear: accepted\n");
  EXPECT_EQ((*client)->toldRaise(), 7U);
}

}  // namespace
}  // namespace tenon::command
