classdef frictus < handle
  % FRICTUS  Rigs from MATLAB and Octave, over the WebSocket /v1/live and HTTP.
  %
  %   f = frictus('127.0.0.1', 8420);           % a token as third argument, where one is needed
  %   f.watch('rig1', {'force', 'accel'});      % raw samples, and every state of the finger
  %   f.arm('rig1');
  %   f.open_stream('rig1', 0.05);              % N: the largest friction that will be sent
  %   f.send(0.04 * cos(2 * pi * (0:63) / 64), 2.0);   % one period, over 2 mm
  %   got = f.read(1.0);                        % got.force.data: channels x samples; got.finger
  %   f.disarm('rig1');
  %   status = f.newest.status;                 % of every message the newest
  %   rigs = f.http('GET', '/v1/rigs');
  %   f.close();                                % disarms
  %
  % While a rig is armed call `read` at least every 3 s, or as often as `arm` was told: the rig is
  % given back when nothing is sent for so long, and `read` pings. Errors have the identifier
  % 'frictus:CODE', such as 'frictus:not_owner'. Octave needs the package instrument-control.
  % What messages mean: docs/websocket.md.

  properties (SetAccess = private)
    client = '';            % name under which rigs know us
    newest = struct();      % newest message of each kind: newest.status.state
    updates = 0;            % texture updates sent over the open stream
  end

  properties (Access = private)
    host
    port
    token
    socket
    answers = {};                  % messages with an id
    refusal = [];                  % of what had no id, until all that came with it is heard
    frames = {};                   % binary messages, until read
    requests = 0;
    offsets = [];                  % of the service's clock to ours, us
    ticket = 0;
    peak_n = 0;                    % the largest friction that was announced for the stream
    streaming = '';                % rig of the open stream
    ended = '';                    % why it has ended
    pinged
    heard
  end

  properties (Constant, Access = private)
    STREAMS = {'force', 'accel', 'voltage', 'truth', 'aux', 'render'};
    MAX_FRAMES = 20000;            % kept until read: beyond, the oldest go and count as lost
    ANSWER_S = 10;
    PING_S = 0.5;
    SILENCE_S = 3;                 % without a word the connection is taken for lost
  end

  methods
    function self = frictus(host, port, token)
      if nargin < 3
        token = '';
      end
      self.host = char(host);
      self.port = port;
      self.token = char(token);
      self.socket = frictus_socket(self.host, port);
      self.pinged = tic();
      self.heard = tic();
      hello = struct('op', 'hello', 'version', 1);
      if ~isempty(token)
        hello.token = self.token;
      end
      self.say(hello);
      self.wait_for(@() self.has('welcome'), 'hello');
      version = sscanf(self.newest.welcome.protocol, '%d.%d');
      if version(1) ~= 1 || version(2) < 1
        error('frictus:version', 'the service speaks %s, not 1.1', self.newest.welcome.protocol);
      end
      self.client = self.newest.welcome.client;
    end

    function watch(self, rig, streams, samples_per_column)
      % WATCH  Be told of a rig: streams as a cell array; samples as they are, or, above 1, the
      % minima and maxima of so many.
      if nargin < 3
        streams = {};
      end
      if nargin < 4
        samples_per_column = 1;
      end
      asked = struct('op', 'watch', 'rig', rig, 'fingers', true, ...
        'raw', samples_per_column == 1, 'samples_per_column', samples_per_column);
      asked.streams = cellstr(streams);  % struct() would make an array of structs of a cell
      if isempty(streams)
        asked = rmfield(asked, 'streams');
      end
      self.frames = {};
      self.say(asked);
    end

    function arm(self, rig, lease_ms)
      % ARM  Take a rig and let it drive its screen; lease_ms is 500 to 10000, 3000 if left out.
      if nargin < 3
        lease_ms = 3000;
      end
      self.ask(struct('op', 'arm', 'rig', rig, 'lease_ms', lease_ms), 'armed');
    end

    function disarm(self, rig)
      % DISARM  Ramp the output to zero and give the rig back.
      self.ask(struct('op', 'disarm', 'rig', rig), 'disarmed');
    end

    function applied = set_scene(self, rig, scene)
      % SET_SCENE  Replace what the screen feels like. The scene is JSON text, as jsonencode would
      % write a list of one as a number; returns etag and applied.
      id = self.next_id();
      self.say_text(sprintf('{"op":"set_scene","rig":"%s","id":%d,"scene":%s}', rig, id, scene));
      applied = self.answer(id, 'scene_set');
    end

    function applied = open_stream(self, rig, peak_n)
      % OPEN_STREAM  Announce a streamed texture; returns what the rig made of its peak.
      opened = self.ask(struct('op', 'open_stream', 'rig', rig, 'peak_n', peak_n), ...
        'stream_opened');
      self.ticket = opened.ticket;
      self.peak_n = peak_n;
      self.streaming = rig;
      self.ended = '';
      self.updates = 0;
      applied = opened.applied;
    end

    function send(self, friction_n, period_mm, ttl_ms, angle_deg)
      % SEND  Send one period of friction, N, 2 to 4096 samples over period_mm; ttl_ms (500) is
      % for how long the rig may still take it, angle_deg (0) the direction of its phase. Once
      % `read` has heard that the stream has ended, as when somebody stops the rig, it is an error.
      if nargin < 4
        ttl_ms = 500;
      end
      if nargin < 5
        angle_deg = 0;
      end
      if ~isempty(self.ended)
        error('frictus:no_stream', 'the stream has ended: %s', self.ended);
      end
      if self.ticket == 0
        error('frictus:no_stream', 'open a texture stream first');
      end
      if numel(friction_n) < 2 || numel(friction_n) > 4096 || ~all(isfinite(friction_n(:)))
        error('frictus:bad_request', '2 to 4096 finite samples are one period');
      end
      if max(abs(friction_n(:))) > self.peak_n * (1 + 1e-6)
        error('frictus:bad_request', 'friction: within the declared peak of %g N', self.peak_n);
      end
      utc_ns = uint64(own_us() + max(self.offsets)) * uint64(1000);
      self.socket.send(2, [uint8('FRTX'), bytes_of(uint16([1 0])), ...
        bytes_of(uint32([self.ticket numel(friction_n)])), ...
        bytes_of([uint64(self.updates) utc_ns]), bytes_of(uint32([ttl_ms 0])), ...
        bytes_of(double([period_mm angle_deg])), bytes_of(uint64(0)), ...
        bytes_of(single(friction_n(:)'))]);
      self.updates = self.updates + 1;
    end

    function closed = close_stream(self)
      % CLOSE_STREAM  End the texture stream; returns how many updates were sent, superseded
      % by newer ones, and expired.
      self.ticket = 0;
      self.ended = '';
      closed = self.ask(struct('op', 'close_stream'), 'stream_closed');
    end

    function point(self, x_mm, y_mm, in_contact)
      % POINT  Move the finger of the watched rig, if it is simulated and follows clients.
      if nargin < 4
        in_contact = true;
      end
      self.say(struct('op', 'point', 'x_mm', x_mm, 'y_mm', y_mm, 'in_contact', in_contact));
    end

    function got = read(self, seconds)
      % READ  Read for some seconds. Of each stream a struct: data, channels x samples (where
      % extremes were asked for, low and high), sample (device index of each column: it jumps
      % where some are lost), first_sample, lost, sample_rate_hz, run, utc_ns (uint64, of the first
      % sample); got.finger has a field for each quantity, and lost. Where the rig has started anew,
      % what is of its next run is for the next read.
      self.pump(seconds);
      taken = self.frames;
      self.frames = {};
      if ~isempty(taken)
        of_run = cellfun(@(one) one.run == taken{1}.run, taken);
        self.frames = taken(~of_run);
        taken = taken(of_run);
      end
      got = struct();
      names = cellfun(@(one) one.name, taken, 'UniformOutput', false);
      for name = unique(names)
        of_it = [taken{strcmp(names, name{1})}];
        parts = {of_it.data};
        joined = of_it(1);
        joined.lost = sum([of_it.lost]);
        joined.data = [parts{:}];
        joined.columns = size(joined.data, 2);
        if joined.kind == 1
          rows = 1:2:size(joined.data, 1);
          joined.low = joined.data(rows, :);
          joined.high = joined.data(rows + 1, :);
        end
        samples = arrayfun(@samples_of, of_it, 'UniformOutput', false);
        joined.sample = [samples{:}];
        if joined.kind == 2
          joined = finger_of(joined);
        end
        got.(name{1}) = joined;
      end
    end

    function answer = http(self, method, path, body, header, within_s)
      % HTTP  Ask REST; body is JSON text. (webwrite sends no text as it is.) PUT and DELETE
      % replace what stands there; header 'If-None-Match: *' makes a new texture. Answers that
      % are no JSON are returned as text or bytes. Waits for within_s (10) of silence.
      if nargin < 4
        body = '';
      end
      if nargin < 5
        header = '';
      end
      if nargin < 6
        within_s = 10;
      end
      answer = frictus_http(self.host, self.port, self.token, method, path, body, header, ...
        within_s);
    end

    function close(self)
      % CLOSE  End the connection; what is armed is disarmed.
      if ~isempty(self.socket)
        self.socket.close();
      end
      self.ticket = 0;
    end

    function delete(self)
      self.close();
    end
  end

  methods (Access = private)
    function say(self, message)
      self.say_text(jsonencode(message));
    end

    function say_text(self, text)
      self.socket.send(1, frictus_socket.utf8(text));
    end

    function id = next_id(self)
      self.requests = self.requests + 1;
      id = self.requests;
    end

    function answered = ask(self, message, op)
      message.id = self.next_id();
      self.say(message);
      answered = self.answer(message.id, op);
    end

    function answered = answer(self, id, op)
      is_it = @(one) isequal(one.id, id);
      self.wait_for(@() any(cellfun(is_it, self.answers)), op);
      which = find(cellfun(is_it, self.answers), 1);
      answered = self.answers{which};
      self.answers(which) = [];
      if strcmp(answered.op, 'refused')
        error(['frictus:' answered.code], '%s', answered.message);
      end
    end

    function is_there = has(self, op)
      is_there = isfield(self.newest, op);
    end

    function wait_for(self, holds, what)
      began = tic();
      while ~holds()
        if toc(began) > self.ANSWER_S
          error('frictus:no_answer', 'the service has not answered: %s', what);
        end
        self.pump(0.005);
      end
    end

    function pump(self, seconds)
      began = tic();
      while true
        if self.has('welcome') && toc(self.pinged) > self.PING_S
          if toc(self.pinged) > 2 * self.PING_S
            self.heard = tic();  % nobody has read: what was not asked for is not missing
          end
          self.pinged = tic();
          self.say(struct('op', 'ping', 'id', 0));
        end
        messages = self.socket.receive();
        if ~isempty(messages)
          self.heard = tic();
        elseif toc(self.heard) > self.SILENCE_S
          self.socket.close();
          error('frictus:closed', 'the service has fallen silent: connect again');
        end
        for message = messages
          self.hear(message{1}{1}, message{1}{2});
        end
        self.tell_refusal();
        left = seconds - toc(began);
        if left <= 0
          return
        end
        if isempty(messages)
          pause(min(left, 0.005));  % then many bytes at once: many small reads are slow
        end
      end
    end

    function hear(self, opcode, payload)
      switch opcode
        case 1
          told = jsondecode(frictus_socket.text(payload));
          self.tell(told);
        case 2
          one = frame_of(payload, self.STREAMS);
          if ~isempty(one)
            self.frames{end + 1} = one;
          end
          if numel(self.frames) > self.MAX_FRAMES
            lost = self.frames{1};
            self.frames(1) = [];
            later = find(cellfun(@(next) strcmp(next.name, lost.name), self.frames), 1);
            if ~isempty(later)
              self.frames{later}.lost = self.frames{later}.lost + lost.lost + lost.columns;
            end
          end
        case 8
          self.socket.close();
          self.tell_refusal();
          error('frictus:closed', 'the service has closed the connection: %s', ...
            frictus_socket.text(payload(3:end)));
        case 9
          self.socket.send(10, payload);
      end
    end

    function note_end(self, told)
      % Whoever goes on sending is to know that nothing is felt of it.
      if self.ticket == 0
        return
      elseif strcmp(told.op, 'stream_closed') && isequal(told.ticket, self.ticket)
        why = 'it was closed';
      elseif strcmp(told.op, 'disarmed') && strcmp(told.rig, self.streaming)
        why = 'the rig was given back';
      else
        return
      end
      if ~isempty(told.reason)
        why = told.reason;
      end
      self.ended = why;
      self.ticket = 0;
    end

    function tell(self, told)
      self.note_end(told);
      if isfield(told, 'utc_us')
        self.offsets = [self.offsets(max(1, end - 14):end), told.utc_us - own_us()];
      end
      if isfield(told, 'id') && ~isempty(told.id) && ~strcmp(told.op, 'pong')
        self.answers{end + 1} = told;
      elseif strcmp(told.op, 'refused')
        self.refusal = told;
      end
      op = told.op;
      if isfield(told, op)
        told = told.(op);  % what a rig says of itself
      end
      self.newest.(op) = told;
    end

    function tell_refusal(self)
      told = self.refusal;
      self.refusal = [];
      if ~isempty(told)
        error(['frictus:' told.code], '%s', told.message);
      end
    end
  end
end

function bytes = bytes_of(values)
  bytes = typecast(values, 'uint8');  % little-endian, as all machines of MATLAB and Octave
end

function us = own_us()
  if exist('OCTAVE_VERSION', 'builtin')
    us = 1e6 * time();
  else
    us = 1e6 * posixtime(datetime('now', 'TimeZone', 'UTC'));
  end
end

function one = frame_of(bytes, streams)
  % Return what a binary message holds; [] where it is of a later version.
  one = [];
  if numel(bytes) < 56
    error('frictus:frame', '%d bytes: the header alone takes 56', numel(bytes));
  end
  short = typecast(bytes(1:8), 'uint16');
  counts = double(typecast(bytes([9:16, 41:48]), 'uint32'));
  kind = counts(4);
  stream = double(short(2));
  if short(1) ~= 1 || kind > 2 || (kind < 2 && stream > numel(streams))
    return
  end
  if kind == 2
    one.name = 'finger';
  else
    one.name = streams{stream};
  end
  rows = double(short(3)) * (1 + (kind == 1));
  if numel(bytes) ~= 56 + 4 * rows * counts(2)
    error('frictus:frame', '%d bytes: %d columns do not fill them', numel(bytes), counts(2));
  end
  one.kind = kind;
  one.run = counts(1);
  one.columns = counts(2);
  one.samples_per_column = counts(3);
  one.first_sample = double(typecast(bytes(17:24), 'uint64'));
  one.lost = double(typecast(bytes(25:32), 'uint64'));
  one.sample_rate_hz = typecast(bytes(33:40), 'double');
  one.utc_ns = typecast(bytes(49:56), 'uint64');
  one.data = reshape(typecast(bytes(57:end), 'single'), counts(2), rows)';
end

function samples = samples_of(one)
  % Return the device index of each column of a frame.
  samples = one.first_sample + (0:one.columns - 1) * one.samples_per_column;
  if one.kind == 2
    samples = one.first_sample + double(one.data(1, :));
  end
end

function finger = finger_of(joined)
  names = {'x_mm', 'y_mm', 'vx_mm_s', 'vy_mm_s', 'normal_force_n', 'age_ms'};
  finger = struct('sample', joined.sample, 'lost', joined.lost, 'run', joined.run, ...
    'sample_rate_hz', joined.sample_rate_hz, 'utc_ns', joined.utc_ns);
  for index = 1:numel(names)
    finger.(names{index}) = joined.data(index + 1, :);
  end
  flags = uint8(joined.data(8, :));
  finger.in_contact = bitand(flags, 1) > 0;
  finger.stale = bitand(flags, 2) > 0;
  finger.extrapolated = bitand(flags, 4) > 0;
end
