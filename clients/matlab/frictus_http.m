function answer = frictus_http(host, port, token, method, path, body, header, within_s)
  % FRICTUS_HTTP  Ask REST at a service; body is JSON text. See docs/rest.md.
  %
  % The answer is what its JSON holds; of other types the text, or the bytes as uint8. PUT and
  % DELETE replace what stands there, unless `header` says what else, such as
  % 'If-None-Match: *' to make a new texture. Nothing for `within_s` (10) is no answer.
  link = frictus_socket.open(host, port);
  body = frictus_socket.utf8(body);
  lines = sprintf('%s %s HTTP/1.1\r\nHost: %s:%d\r\nConnection: close\r\n', method, path, ...
    host, port);
  if ~isempty(token)
    lines = [lines sprintf('Authorization: Bearer %s\r\n', token)];
  end
  if ~isempty(body)
    lines = [lines sprintf('Content-Type: application/json\r\nContent-Length: %d\r\n', ...
      numel(body))];
  end
  if isempty(header) && any(strcmp(method, {'PUT', 'DELETE'}))
    header = 'If-Match: *';
  end
  if ~isempty(header)
    lines = [lines sprintf('%s\r\n', header)];
  end
  write(link, [frictus_socket.utf8([lines sprintf('\r\n')]), body]);
  [head, content] = http_answer(link, within_s);
  clear link
  kind = field_of(head, 'content-type');
  answer = content;
  if ~isempty(strfind(kind, 'json')) && ~isempty(content)
    answer = jsondecode(frictus_socket.text(content));
  elseif isempty(content)
    answer = [];
  elseif strncmp(kind, 'text/', 5)
    answer = frictus_socket.text(content);
  end
  status = sscanf(head, 'HTTP/1.1 %d');
  if isempty(status)
    error('frictus:no_answer', '%s %s: no whole answer came', method, path);
  elseif status >= 400
    if isfield(answer, 'code')
      error(['frictus:' answer.code], '%s %s: %s', method, path, answer.detail);
    end
    error('frictus:bad_http', '%s %s: %s', method, path, strtok(head, sprintf('\r')));
  end
end

function [head, content] = http_answer(link, within_s)
  % Return head and content; an empty head where they have not come whole.
  heard = tic();
  head = '';
  content = zeros(1, 0, 'uint8');
  wanted = Inf;
  while toc(heard) < within_s
    bytes = frictus_socket.available(link);
    if isempty(bytes)
      pause(0.005);
      continue
    end
    heard = tic();
    content = [content, bytes];
    at = strfind(char(content(1:min(end, 65536))), sprintf('\r\n\r\n'));
    if isempty(head) && ~isempty(at)
      head = char(content(1:at(1)));
      content = content(at(1) + 4:end);
      wanted = str2double(field_of(head, 'content-length'));
      if isnan(wanted)
        wanted = 0;  % as 204 and 304 have none
      end
    end
    if ~isempty(head) && numel(content) >= wanted
      return
    end
  end
  head = '';
end

function value = field_of(head, name)
  found = regexp(head, [name ': *([^\r]*)'], 'tokens', 'once', 'ignorecase');
  value = '';
  if ~isempty(found)
    value = found{1};
  end
end
