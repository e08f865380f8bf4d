% handwritten.m: the robot's 0.5 s fall with the paper's own program (Table 8), for Octave and Matlab.
%
%   handwritten('robot.json')      the tables, as ncgen's benchmark writes them; prints what it found as JSON
%
% Names and structure are the paper's. Mended are its slips (docs/paper.md lists them): R has as many columns as there are
% degrees of freedom, a parenthesis is closed, and an angle's row is
%
%   [sin psi a.b - cos psi (a x b).n / |n|] / (|a| |b|)        a, b perpendicular to n
%
% which does not degenerate where the paper's sine and cosine rows do.

function handwritten(path)
  s = jsondecode(fileread(path));
  y0 = [zeros(numel(s.qind), 1); s.qini(s.qind)];
  rhs = @(t, y) derivR(t, y, s);

  tic; y = rk4(rhs, s.duration, y0, s.steps); found(1) = result('RK4', toc, y, 4 * s.steps);

  options = odeset('RelTol', s.rtol, 'AbsTol', s.atol);
  evaluations(0);
  tic; [~, ys] = ode45(@(t, y) counted(rhs, t, y), [0 s.duration], y0, options);
  found(2) = result('ode45', toc, ys(end, :)', evaluations());
  fprintf('%s\n', jsonencode(found));
end

function r = result(tool, seconds, y, count)
  r = struct('tool', tool, 'seconds', seconds, 'psi', y(end/2+1:end)', 'evaluations', count);
end

function n = evaluations(set)
  persistent count
  if nargin, count = set; end
  n = count;
end

function yp = counted(rhs, t, y)
  evaluations(evaluations() + 1);
  yp = rhs(t, y);
end

function y = rk4(rhs, duration, y, steps)
  h = duration / steps;
  for i = 0:steps-1
    t = i * h;
    k1 = rhs(t, y);
    k2 = rhs(t + h/2, y + h/2 * k1);
    k3 = rhs(t + h/2, y + h/2 * k2);
    y = y + h/6 * (k1 + 2*k2 + 2*k3 + rhs(t + h, y + h * k3));
  end
end

% -- Table 8 ------------------------------------------------------------------------------------------------------------

function yp = derivR(t, y, s)
  tol = 1e-12; nitmax = 40;
  persistent qprev
  if t == 0, qprev = s.qini; end
  dof = numel(s.qind); n = numel(s.qini);
  q = qprev; q(s.qind) = y(dof+1:2*dof);
  vi = y(1:dof);
  % the position problem
  Phi = formPhi(q, s.CONSTR, s.P, s.U); err = norm(Phi); nit = 0;
  while err > tol && nit < nitmax
    Phiq = formPhiq(q, s.CONSTR, s.P, s.U);
    q(s.qdep) = q(s.qdep) - Phiq(:, s.qdep) \ Phi;
    Phi = formPhi(q, s.CONSTR, s.P, s.U); err = norm(Phi); nit = nit + 1;
  end
  qprev = q;
  % the Jacobian and the matrix R
  Phiq = formPhiq(q, s.CONSTR, s.P, s.U);
  R = zeros(n, dof);
  R(s.qdep, :) = -Phiq(:, s.qdep) \ Phiq(:, s.qind);
  R(s.qind, :) = eye(dof);
  % the velocities and Rpqip
  v = zeros(n, 1); v(s.free) = R(s.free, :) * vi;
  c = formPhiqpqp(q, v, s.CONSTR, s.P, s.U);
  Rpqip = zeros(n, 1); Rpqip(s.qdep) = Phiq(:, s.qdep) \ c;
  % the dynamic terms and the independent accelerations
  [M, Q] = massAndForces(q, v, s.bodies);
  f = s.free;
  ai = (R(f, :)' * M(f, f) * R(f, :)) \ (R(f, :)' * (Q(f) - M(f, f) * Rpqip(f)));
  yp = [ai; vi];
end

% -- the constraint table -----------------------------------------------------------------------------------------------

function k = pt(P, i)
  k = P(i) : P(i) + 2;
end

function k = vec(U, i)
  k = U(abs(i)) : U(abs(i)) + 2;
end

% a, b and n of an angle row, with their places: x(ends) - x(starts), an empty start for vectors
function [a, b, n, places, scale, ln] = angleVectors(row, x, P, U)
  i = row(2); j = row(3); k = row(4); l = row(5); w = row(6); ln = 1; scale = 1;
  switch row(1)
    case 1010
      places = {pt(P, j), pt(P, i), pt(P, l), pt(P, k), vec(U, w), []}; signs = sign(w); scale = 1 / (row(10) * row(11));
    case 1012
      places = {vec(U, i), [], vec(U, j), [], vec(U, k), []}; signs = sign(k);
    case 1013
      places = {vec(U, i), [], vec(U, j), [], pt(P, k), pt(P, l)}; signs = 1; ln = row(11);
    case 1014
      places = {vec(U, i), [], pt(P, j), pt(P, k), vec(U, l), []}; signs = sign(l); scale = 1 / row(11);
  end
  a = difference(x, places{1}, places{2});
  b = difference(x, places{3}, places{4});
  n = difference(x, places{5}, places{6}) * signs / ln;
  ln = signs / ln;
end

function d = difference(x, ends, starts)
  d = x(ends);
  if ~isempty(starts), d = d - x(starts); end
end

function c = crossed(a, b)
  c = [a(2)*b(3) - a(3)*b(2); a(3)*b(1) - a(1)*b(3); a(1)*b(2) - a(2)*b(1)];
end

function Phi = formPhi(q, CONSTR, P, U)
  Phi = zeros(size(CONSTR, 1), 1);
  for r = 1:size(CONSTR, 1)
    row = CONSTR(r, :); i = row(2); j = row(3); k = row(4);
    switch row(1)
      case 1000
        d = q(pt(P, i)) - q(pt(P, j)); Phi(r) = (d' * d - row(12)^2) / (2 * row(12));
      case 1001
        u = q(vec(U, i)); Phi(r) = (u' * u - 1) / 2;
      case 1002
        Phi(r) = q(vec(U, i))' * (q(pt(P, j)) - q(pt(P, k))) / row(11) - row(12);
      case 1003
        Phi(r) = q(vec(U, i))' * q(vec(U, j)) - row(12);
      otherwise
        [a, b, n, ~, scale] = angleVectors(row, q, P, U); psi = q(39 + row(12));
        Phi(r) = scale * (sin(psi) * (a' * b) - cos(psi) * (crossed(a, b)' * n));
    end
  end
end

function Phiq = formPhiq(q, CONSTR, P, U)
  Phiq = zeros(size(CONSTR, 1), numel(q));
  for r = 1:size(CONSTR, 1)
    row = CONSTR(r, :); i = row(2); j = row(3); k = row(4);
    switch row(1)
      case 1000
        d = (q(pt(P, i)) - q(pt(P, j)))' / row(12);
        Phiq(r, pt(P, i)) = d; Phiq(r, pt(P, j)) = -d;
      case 1001
        Phiq(r, vec(U, i)) = q(vec(U, i))';
      case 1002
        u = q(vec(U, i))' / row(11);
        Phiq(r, vec(U, i)) = (q(pt(P, j)) - q(pt(P, k)))' / row(11);
        Phiq(r, pt(P, j)) = u; Phiq(r, pt(P, k)) = -u;
      case 1003
        Phiq(r, vec(U, i)) = q(vec(U, j))'; Phiq(r, vec(U, j)) = q(vec(U, i))';
      otherwise
        [a, b, n, places, scale, ln] = angleVectors(row, q, P, U); psi = 39 + row(12);
        s = scale * sin(q(psi)); c = scale * cos(q(psi)); ab = crossed(a, b);
        gradients = {s * b - c * crossed(b, n), s * a - c * crossed(n, a), -c * ln * ab};
        for m = 1:3
          Phiq(r, places{2*m-1}) = Phiq(r, places{2*m-1}) + gradients{m}';
          if ~isempty(places{2*m}), Phiq(r, places{2*m}) = Phiq(r, places{2*m}) - gradients{m}'; end
        end
        Phiq(r, psi) = c * (a' * b) + s * (ab' * n);
    end
  end
end

% minus the time derivative of Phiq, times v
function c = formPhiqpqp(q, v, CONSTR, P, U)
  c = zeros(size(CONSTR, 1), 1);
  for r = 1:size(CONSTR, 1)
    row = CONSTR(r, :); i = row(2); j = row(3); k = row(4);
    switch row(1)
      case 1000
        d = v(pt(P, i)) - v(pt(P, j)); c(r) = -(d' * d) / row(12);
      case 1001
        u = v(vec(U, i)); c(r) = -(u' * u);
      case 1002
        c(r) = -2 * v(vec(U, i))' * (v(pt(P, j)) - v(pt(P, k))) / row(11);
      case 1003
        c(r) = -2 * v(vec(U, i))' * v(vec(U, j));
      otherwise
        [a, b, n, ~, scale] = angleVectors(row, q, P, U); [da, db, dn] = angleVectors(row, v, P, U);
        s = sin(q(39 + row(12))); co = cos(q(39 + row(12))); w = v(39 + row(12));
        ab = crossed(a, b); dab = crossed(da, b) + crossed(a, db);
        D = a' * b; dD = da' * b + a' * db; ddD = 2 * (da' * db);
        T = ab' * n; dT = dab' * n + ab' * dn; ddT = 2 * (crossed(da, db)' * n + dab' * dn);
        c(r) = -scale * (s * (ddD - w^2 * D + 2 * w * dT) + co * (2 * w * dD - ddT + w^2 * T));
    end
  end
end

% -- inertia and weight -------------------------------------------------------------------------------------------------

% Bodies on two points and a vector have the third direction (rj - ri) x u: twelve elements depend on nine.
function [M, Q] = massAndForces(q, v, bodies)
  n = numel(q); M = zeros(n); Q = zeros(n, 1);
  for b = 1:numel(bodies)
    body = bodies(b); k = body.places; M12 = body.mass; Q12 = body.weight;
    if numel(k) == 9
      x1 = q(k(4:6)) - q(k(1:3)); u = q(k(7:9));
      W = [eye(9); tilde(u), -tilde(u), tilde(x1)];
      turning = 2 * crossed(v(k(4:6)) - v(k(1:3)), v(k(7:9)));
      Q(k) = Q(k) + W' * (Q12 - M12(:, 10:12) * turning);
      M(k, k) = M(k, k) + W' * M12 * W;
    else
      M(k, k) = M(k, k) + M12; Q(k) = Q(k) + Q12;
    end
  end
end

function m = tilde(a)
  m = [0 -a(3) a(2); a(3) 0 -a(1); -a(2) a(1) 0];
end
