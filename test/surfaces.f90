!> Surfaces that tests share: triangles of boxes, balls, tori and prisms, and their STL files.
module surfaces
  use pd_base_kinds, only: wp, sp, i4
  implicit none (type, external)
  private
  public :: box_facets, ball_facets, torus_facets, prism_facets, turned, reversed, joined, &
    & binary_stl, ascii_stl

  character(1), parameter :: lf = achar(10)
  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> A box, two triangles for each side: x_min, x_max, y_min, y_max, z_min, z_max.
  function box_facets(low, high) result(x)
    real(wp), intent(in) :: low(3), high(3)
    real(wp) :: x(3, 3, 12)
    real(wp) :: corner(3, 8)
    integer, parameter :: sides(4, 6) = reshape([1, 5, 7, 3, 2, 4, 8, 6, 1, 2, 6, 5, 3, 7, 8, 4, &
      & 1, 3, 4, 2, 5, 6, 8, 7], [4, 6])
    integer :: i, c

    do i = 1, 8
      do c = 1, 3
        corner(c, i) = merge(high(c), low(c), btest(i - 1, c - 1))
      end do
    end do
    do i = 1, 6
      x(:, :, 2*i - 1) = corner(:, sides([1, 2, 3], i))
      x(:, :, 2*i) = corner(:, sides([1, 3, 4], i))
    end do
  end function box_facets

  !> Triangles between the points of a grid: `wrap` where its last row meets its first one.
  function grid_facets(p, wrap) result(x)
    real(wp), intent(in) :: p(:, :, :)       !! (3, rows, columns), columns are closed
    logical, intent(in) :: wrap
    real(wp), allocatable :: x(:, :, :)
    integer :: i, j, k, l, n

    allocate (x(3, 3, 2*size(p, 2)*size(p, 3)))
    n = 0
    do j = 1, size(p, 3)
      l = mod(j, size(p, 3)) + 1
      do i = 1, size(p, 2)
        if (i == size(p, 2) .and. .not. wrap) cycle
        k = mod(i, size(p, 2)) + 1
        call add(p(:, i, j), p(:, k, j), p(:, k, l))
        call add(p(:, i, j), p(:, k, l), p(:, i, l))
      end do
    end do
    x = x(:, :, :n)

  contains

    subroutine add(a, b, c)
      real(wp), intent(in) :: a(3), b(3), c(3)

      if (all(abs(a - b) <= 0.0_wp) .or. all(abs(b - c) <= 0.0_wp) .or. &
        & all(abs(c - a) <= 0.0_wp)) return
      n = n + 1
      x(:, 1, n) = a
      x(:, 2, n) = b
      x(:, 3, n) = c
    end subroutine add

  end function grid_facets

  !> A ball of n rows from pole to pole.
  function ball_facets(radius, n) result(x)
    real(wp), intent(in) :: radius
    integer, intent(in) :: n
    real(wp), allocatable :: x(:, :, :)
    real(wp) :: p(3, n + 1, 2*n), s
    integer :: i, j

    do j = 1, 2*n
      do i = 0, n
        s = sin(pi*i/n)
        if (i == 0 .or. i == n) s = 0.0_wp
        p(:, i + 1, j) = radius*[s*cos(pi*(j - 1)/n), s*sin(pi*(j - 1)/n), cos(pi*i/n)]
      end do
    end do
    x = grid_facets(p, .false.)
  end function ball_facets

  !> A torus around z.
  function torus_facets(large, small, n, m) result(x)
    real(wp), intent(in) :: large, small
    integer, intent(in) :: n, m              !! along the ring, around the tube
    real(wp), allocatable :: x(:, :, :)
    real(wp) :: p(3, m, n), a, b
    integer :: i, j

    do j = 1, n
      do i = 1, m
        a = 2*pi*(j - 1)/n
        b = -2*pi*(i - 1)/m
        p(:, i, j) = [(large + small*cos(b))*cos(a), (large + small*cos(b))*sin(a), small*sin(b)]
      end do
    end do
    x = grid_facets(p, .true.)
  end function torus_facets

  !> A prism of n sides around z, from z = 0: its volume is n/2 r^2 sin(2 pi/n) height.
  function prism_facets(radius, height, n) result(x)
    real(wp), intent(in) :: radius, height
    integer, intent(in) :: n
    real(wp), allocatable :: x(:, :, :)
    real(wp) :: p(3, 4, n), c, s
    integer :: j

    do j = 1, n
      c = radius*cos(2*pi*(j - 1)/n)
      s = radius*sin(2*pi*(j - 1)/n)
      p(:, :, j) = reshape([0.0_wp, 0.0_wp, height, c, s, height, c, s, 0.0_wp, 0.0_wp, 0.0_wp, &
        & 0.0_wp], [3, 4])
    end do
    x = grid_facets(p, .false.)
  end function prism_facets

  !> Turned about two axes and moved, as no lattice is.
  function turned(x) result(y)
    real(wp), intent(in) :: x(:, :, :)
    real(wp) :: y(3, 3, size(x, 3)), a(3, 3), b(3, 3)
    integer :: f

    a = reshape([cos(0.4_wp), sin(0.4_wp), 0.0_wp, -sin(0.4_wp), cos(0.4_wp), 0.0_wp, 0.0_wp, &
      & 0.0_wp, 1.0_wp], [3, 3])
    b = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, cos(0.7_wp), sin(0.7_wp), 0.0_wp, -sin(0.7_wp), &
      & cos(0.7_wp)], [3, 3])
    do f = 1, size(x, 3)
      y(:, :, f) = matmul(b, matmul(a, x(:, :, f))) + 0.3_wp
    end do
  end function turned

  !> Facing the other way.
  function reversed(x) result(y)
    real(wp), intent(in) :: x(:, :, :)
    real(wp) :: y(3, 3, size(x, 3))
    y = x(:, [1, 3, 2], :)
  end function reversed

  function joined(a, b) result(x)
    real(wp), intent(in) :: a(:, :, :), b(:, :, :)
    real(wp) :: x(3, 3, size(a, 3) + size(b, 3))
    x(:, :, :size(a, 3)) = a
    x(:, :, size(a, 3) + 1:) = b
  end function joined

  !> A binary file, with numbers in single precision.
  function binary_stl(x) result(text)
    real(wp), intent(in) :: x(:, :, :)
    character(:), allocatable :: text
    integer :: f, i, k, at

    allocate (character(84 + 50*size(x, 3)) :: text)
    text = repeat(achar(0), len(text))
    text(81:84) = four(int(size(x, 3), i4))
    at = 84
    do f = 1, size(x, 3)
      do i = 1, 3
        do k = 1, 3
          text(at + 12*i + 4*k - 3:at + 12*i + 4*k) = four(transfer(real(x(k, i, f), sp), 0_i4))
        end do
      end do
      at = at + 50
    end do
  end function binary_stl

  !> Four bytes, the low one first.
  function four(bits) result(bytes)
    integer(i4), intent(in) :: bits
    character(4) :: bytes
    integer :: i

    do i = 1, 4
      bytes(i:i) = char(ibits(bits, 8*(i - 1), 8))
    end do
  end function four

  !> A text of one solid, with numbers as they are in single precision.
  function ascii_stl(x, name) result(text)
    real(wp), intent(in) :: x(:, :, :)
    character(*), intent(in) :: name
    character(:), allocatable :: text
    character(80) :: line
    character(:), allocatable :: room
    integer :: f, i, n

    allocate (character(len(name) + 350*size(x, 3) + 100) :: room)
    n = 0
    call put('solid '//name)
    do f = 1, size(x, 3)
      call put(' facet normal 0 0 0')
      call put('  outer loop')
      do i = 1, 3
        write (line, '(a, 3(1x, es17.9))') '   vertex', real(x(:, i, f), sp)
        call put(trim(line))
      end do
      call put('  endloop')
      call put(' endfacet')
    end do
    call put('endsolid '//name)
    text = room(:n)

  contains

    subroutine put(words)
      character(*), intent(in) :: words
      room(n + 1:n + len(words) + 1) = words//lf
      n = n + len(words) + 1
    end subroutine put

  end function ascii_stl

end module surfaces
