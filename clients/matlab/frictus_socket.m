classdef frictus_socket < handle
  % FRICTUS_SOCKET  The WebSocket under FRICTUS: handshake and frames (RFC 6455) over tcpclient.

  properties (Access = private)
    link = [];
    held = zeros(1, 0, 'uint8');   % received, not yet taken
  end

  properties (Constant, Access = private)
    WAIT_S = 10;
    MAX_BYTES = 4194304;           % of one message
  end

  methods
    function self = frictus_socket(host, port)
      self.link = frictus_socket.open(host, port);
      self.put(uint8(sprintf(['GET /v1/live HTTP/1.1\r\nHost: %s:%d\r\n' ...
        'Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n' ...
        'Sec-WebSocket-Key: ZnJpY3R1cyBpcyBub2lzeQ==\r\n\r\n'], host, port)));
      head = self.head();
      if isempty(strfind(head, ' 101 '))
        error('frictus:no_websocket', 'no WebSocket at %s:%d: %s', host, port, ...
          strtok(head, sprintf('\r')));
      end
    end

    function send(self, opcode, payload)
      % SEND  Send a message: opcode 1 text, 2 binary, 10 pong. Masked, as clients must.
      size = numel(payload);
      if size > 65535
        error('frictus:too_large', 'a message has at most 65535 bytes');
      end
      if size < 126
        head = uint8([128 + opcode, 128 + size]);
      else
        head = uint8([128 + opcode, 254, floor(size / 256), mod(size, 256)]);
      end
      mask = uint8(randi([0 255], 1, 4));
      masks = repmat(mask, 1, ceil(size / 4));
      self.put([head, mask, bitxor(payload, masks(1:size))]);
    end

    function messages = receive(self)
      % RECEIVE  Return what has come whole, without waiting: a row of {opcode, payload}.
      self.arrived();
      messages = {};
      at = 0;
      while numel(self.held) >= at + 2
        opcode = bitand(self.held(at + 1), 15);
        size = double(self.held(at + 2));
        head = 2;
        if size == 126
          head = 4;
        elseif size == 127
          head = 10;
        end
        if numel(self.held) < at + head
          break
        end
        if head > 2
          size = polyval(double(self.held(at + 3:at + head)), 256);
        end
        if size > self.MAX_BYTES || self.held(at + 1) < 128 || self.held(at + 2) > 127
          self.close();
          error('frictus:frame', 'a frame that no service sends: is this a WebSocket?');
        end
        if numel(self.held) < at + head + size
          break
        end
        messages{end + 1} = {opcode, self.held(at + head + 1:at + head + size)};
        at = at + head + size;
      end
      self.held = self.held(at + 1:end);
    end

    function close(self)
      self.link = [];
    end
  end

  methods (Access = private)
    function put(self, bytes)
      if isempty(self.link)
        error('frictus:closed', 'the connection has ended: connect again');
      end
      write(self.link, bytes);
    end

    function more = arrived(self)
      if isempty(self.link)
        error('frictus:closed', 'the connection has ended: connect again');
      end
      bytes = frictus_socket.available(self.link);
      more = ~isempty(bytes);
      self.held = [self.held, bytes];
    end

    function text = head(self)
      began = tic();
      at = [];
      while isempty(at)
        if ~self.arrived()
          pause(0.005);
        end
        at = strfind(char(self.held), sprintf('\r\n\r\n'));
        if toc(began) > self.WAIT_S || numel(self.held) > 65536
          error('frictus:no_websocket', 'no WebSocket answers there');
        end
      end
      text = char(self.held(1:at(1)));
      self.held = self.held(at(1) + 4:end);
    end
  end

  methods (Static)
    function link = open(host, port)
      % OPEN  Return a connection.
      if exist('OCTAVE_VERSION', 'builtin')
        pkg('load', 'instrument-control');
      end
      try
        link = tcpclient(host, port);
      catch cause
        error('frictus:no_link', 'nobody listens at %s:%d: %s', host, port, cause.message);
      end
    end

    function bytes = utf8(text)
      % UTF8  Return the bytes of a text. To MATLAB characters are UTF-16, to Octave bytes.
      bytes = reshape(unicode2native(text, 'UTF-8'), 1, []);
    end

    function text = text(bytes)
      % TEXT  Return the text that bytes of UTF-8 hold.
      text = native2unicode(bytes, 'UTF-8');
    end

    function bytes = available(link)
      % AVAILABLE  Return all that has come, at once: many small reads are slow.
      count = link.NumBytesAvailable;
      bytes = zeros(1, 0, 'uint8');
      if count > 0
        bytes = uint8(read(link, count));
        bytes = bytes(:)';
      end
    end
  end
end
