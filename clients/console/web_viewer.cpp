#include <algorithm>

#include "clients/console/foxglove_protocol.h"
#include "clients/console/web_service.h"

namespace tenon::console {

namespace {

using std::chrono::seconds;
constexpr std::size_t kMaxMessageBytes = 64U << 10U;
constexpr std::size_t kMaxSubscriptions = 256;
/// A page with a hand sends 63, and those of 2.5 s at once to a gateway that has hung.
constexpr int kMaxMessagesASecond = 400;
constexpr const char* kNoSuchSession =
    "there is no such session: it has ended or not begun, or this gateway shows too many";

}  // namespace

WebViewer::WebViewer(WebService& server, WebStream stream, std::string host, std::string room, From from)
    : server_(server),
      id_(server.next_viewer++),
      host_(std::move(host)),
      room_(std::move(room)),
      from_(from),
      socket_(std::move(stream)),
      send_timer_(server.io) {
  ++server_.connections;
}

WebViewer::~WebViewer() {
  leave();
  --server_.connections;
}

void WebViewer::leave() {
  if (server_.viewers.erase(this) == 0) return;
  server_.viewer_count = server_.viewers.size();
  if (server_.handlers.left) server_.handlers.left(id_, room_);
}

void WebViewer::run(const http::request<http::empty_body>& request, std::string_view subprotocol) {
  auto timeout = websocket::stream_base::timeout::suggested(beast::role_type::server);
  timeout.idle_timeout = seconds(60);
  timeout.keep_alive_pings = true;
  socket_.set_option(timeout);
  socket_.set_option(
      websocket::stream_base::decorator([name = std::string(subprotocol)](websocket::response_type& answer) {
        answer.set(http::field::sec_websocket_protocol, name);
        answer.set(http::field::server, "tenon");
      }));
  socket_.read_message_max(0);  // counted in read(): the library would end the connection without a reason
  socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
    if (!error) self->begin();
  });
}

void WebViewer::offer(const Publication& publication, Delivery delivery) {
  for (const auto& [subscription, channel] : subscriptions_)
    if (channel == publication.channel) queue_.add(subscription, delivery, publication);
}

void WebViewer::send() {
  if (is_sending_ || is_closing_) return;
  if (queue_.hasOverflowed()) {
    close("more was asked for than was read");
    return;
  }
  auto item = queue_.take();
  if (!item) return;
  sent_ = std::move(*item);
  is_sending_ = true;
  send_timer_.expires_after(server_.options.send_timeout);
  send_timer_.async_wait([self = weak_from_this()](beast::error_code error) {
    const auto viewer = self.lock();
    if (!error && viewer) viewer->abort();
  });
  const bool is_text = sent_.payload == nullptr;
  socket_.text(is_text);
  const std::array<asio::const_buffer, 2> buffers{
      is_text ? asio::buffer(sent_.text) : asio::const_buffer(asio::buffer(sent_.header)),
      is_text ? asio::const_buffer() : asio::buffer(*sent_.payload)};
  socket_.async_write(buffers, [self = shared_from_this()](beast::error_code error, std::size_t) {
    self->is_sending_ = false;
    self->send_timer_.cancel();
    self->sent_ = {};
    if (error) return;
    self->send();
    if (self->is_closing_) self->finish();
  });
}

void WebViewer::begin() {
  server_.viewers.insert(this);
  server_.viewer_count = server_.viewers.size();
  if (server_.handlers.entered) server_.handlers.entered(room_);
  const auto room = server_.rooms.find(room_);
  // told by a reason that pages can read: they are not shown the answer to a request that is refused
  if (room == server_.rooms.end()) return close(kNoSuchSession);
  queue_.addText(serverInfoText(server_.options.name, server_.session_id));
  queue_.addText(room->second.advertisement);
  // with the first ones: a page watches a connection from the first heartbeat on
  if (from_ == From::kOwnPage) queue_.addText(heartbeatText());
  send();
  read();
}

void WebViewer::dropMessages() {
  for (const auto& [subscription, channel] : subscriptions_) queue_.remove(subscription);
}

/// Whatever else is being sent says the same.
void WebViewer::sendHeartbeat() {
  if (from_ != From::kOwnPage || is_sending_ || is_closing_) return;
  queue_.addText(heartbeatText());
  send();
}

void WebViewer::leaveRoom() { close("the session is over"); }

/// A piece of a message, and as much of one that is too long as shows that it is.
void WebViewer::read() {
  const std::size_t most = kMaxMessageBytes + 1 - incoming_.size();
  socket_.async_read_some(incoming_, most, [self = shared_from_this()](beast::error_code error, std::size_t) {
    if (error) return self->abort();
    if (self->is_closing_) return;
    if (self->incoming_.size() > kMaxMessageBytes)
      return self->close("a message longer than 64 kB", websocket::close_code::too_big);
    if (self->socket_.is_message_done()) self->receive();
    if (!self->is_closing_) self->read();
  });
}

void WebViewer::receive() {
  const auto now = std::chrono::steady_clock::now();
  if (now - second_ > seconds(1)) {
    second_ = now;
    received_ = 0;
  }
  if (++received_ > kMaxMessagesASecond) {
    close("more than 400 messages a second");
    return;
  }
  const std::string text = beast::buffers_to_string(incoming_.data());
  incoming_.consume(incoming_.size());
  if (!socket_.got_text()) {
    moveHands({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  } else if (const auto request = parseViewerText(text)) {
    apply(*request);
  } else {
    queue_.addText(statusText(StatusLevel::kWarning, "not understood: " + request.error().what));
  }
  send();
}

void WebViewer::moveHands(std::span<const std::uint8_t> targets) {
  const bool may = from_ != From::kElsewhere && server_.handlers.hands;
  if (!may || !server_.handlers.hands(id_, targets))
    queue_.addText(
        statusText(StatusLevel::kWarning, "a binary message that is no target of this viewer's hands"));
}

/// A place begins with the answer that gives it, and ends with the next request for one, or with a notice.
void WebViewer::offer(const DeskAnswer& answer) {
  bool& has_place = answer.is_of_hands ? has_hands_ : has_seat_;
  if (answer.accepted && !answer.role.empty()) has_place = true;
  if (!answer.accepted && answer.id == 0) has_place = false;
  queue_.addText(deskAnswerText(answer));
}

void WebViewer::apply(const ViewerRequest& request) {
  if (request.desk && request.desk->isOfHands()) has_hands_ = false;
  if (request.desk &&
      (request.desk->kind == DeskRequest::Kind::kSit || request.desk->kind == DeskRequest::Kind::kLeave))
    has_seat_ = false;
  if (request.desk && from_ != From::kElsewhere && server_.handlers.desk) {
    server_.handlers.desk(id_, room_, *request.desk);
  } else if (request.desk) {
    queue_.addText(deskAnswerText({.id = request.desk->id,
                                   .text = "pages from elsewhere may look on only",
                                   .is_of_hands = request.desk->isOfHands()}));
  }
  ChannelStore& store = server_.rooms.find(room_)->second.store;
  for (const SubscriptionId id : request.unsubscribe) {
    subscriptions_.erase(id);
    queue_.remove(id);
  }
  for (const auto& [id, channel] : request.subscribe) {
    const Channel* found = store.find(channel);
    std::string problem;
    if (found == nullptr) problem = "there is no channel " + std::to_string(channel);
    if (subscriptions_.contains(id)) problem = "subscription " + std::to_string(id) + " exists";
    const bool has_channel = std::any_of(subscriptions_.begin(), subscriptions_.end(),
                                         [one = channel](const auto& known) { return known.second == one; });
    if (has_channel) problem = "channel " + std::to_string(channel) + " is subscribed already";
    if (id == kHandSubscription) problem = "subscription " + std::to_string(id) + " is not to be chosen";
    if (subscriptions_.size() >= kMaxSubscriptions) problem = "there are too many subscriptions";
    if (!problem.empty()) {
      queue_.addText(statusText(StatusLevel::kWarning, problem));
      continue;
    }
    subscriptions_.emplace(id, channel);
    store.forEachKept(channel,
                      [&, name = id](const Publication& kept) { queue_.add(name, found->delivery, kept); });
  }
}

void WebViewer::close(const std::string& reason, websocket::close_code code) {
  if (is_closing_) return;
  is_closing_ = true;
  close_reason_ = {code, reason};
  if (!is_sending_) finish();
}

void WebViewer::finish() {
  if (is_closed_) return;
  is_closed_ = true;
  send_timer_.expires_after(server_.options.send_timeout);
  send_timer_.async_wait([self = weak_from_this()](beast::error_code error) {
    const auto viewer = self.lock();
    if (!error && viewer) viewer->abort();
  });
  socket_.async_close(close_reason_,
                      [self = shared_from_this()](beast::error_code) { self->send_timer_.cancel(); });
}

void WebViewer::abort() {
  is_closing_ = is_closed_ = true;
  send_timer_.cancel();
  beast::get_lowest_layer(socket_).close();
  leave();
}

}  // namespace tenon::console
