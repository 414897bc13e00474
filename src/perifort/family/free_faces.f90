!> Free faces of cells where lattices of several grids touch: a face that cells of another grid
!> cover belongs to no surface.
module pd_family_free_faces
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type
  use pd_body_side_areas, only: side_areas_type
  use pd_family_areas, only: behind_share, next_points, outermost_share
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  implicit none (type, external)
  private
  public :: find_sides, grids_touch

  real(wp), parameter :: near = 1.0e-6_wp  !! of places and lengths that are the same [spacings]

  !> Free parts of faces.
  type :: faces_type
    integer :: n = 0
    integer, allocatable :: side(:)         !! (faces) key of the side
    integer(i4), allocatable :: slot(:, :)  !! (3, faces) point of the cell and those behind, or 0
    real(wp), allocatable :: area(:)        !! (faces) free part [m2]
  end type faces_type

contains

  !> Whether some face of a cell is covered, in part or as a whole, by cells of another grid.
  logical function grids_touch(body, family) result(touch)
    type(body_type), intent(in) :: body       !! all on lattices, arranged in the family's slots
    class(family_type), intent(in) :: family  !! whole
    type(bonds_type) :: bonds
    integer :: k, c, s, next(-1:1, body%dim)

    touch = .false.
    if (all(body%grid == maxval(body%grid) .or. body%point == 0)) return
    call allocate_bonds(family, bonds)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      call next_points(body, bonds, k, next)
      do c = 1, body%dim
        do s = -1, 1, 2
          if (next(s, c) > 0) cycle
          touch = covered(body, bonds, k, c, s) > near
          if (touch) return
        end do
      end do
    end do
  end function grids_touch

  !> The sides of lattices, with areas of their points by linear extrapolation to the faces, before
  !> they are balanced. Families must be whole. `alone` is a slot with a free face and no second
  !> point of its grid behind it; 0 if there is none.
  subroutine find_sides(body, family, sides, alone)
    type(body_type), intent(in) :: body       !! all on lattices, arranged in the family's slots
    class(family_type), intent(in) :: family  !! whole, with a reach of a spacing at least
    type(side_areas_type), intent(out) :: sides
    integer, intent(out) :: alone
    type(faces_type) :: faces
    integer, allocatable :: keys(:)
    real(wp), allocatable :: share(:)
    logical, allocatable :: there(:)
    integer :: i, f, k, n, pass, entries

    call find_faces(body, family, faces, alone)
    if (alone > 0) return
    allocate (keys(0))
    do f = 1, faces%n
      if (all(keys /= faces%side(f))) keys = [keys, faces%side(f)]
    end do
    n = size(keys)
    sides%body = keys/12
    sides%axis = modulo(keys/2, 3) + 1
    sides%outward = 2*modulo(keys, 2) - 1
    sides%outermost = modulo(keys/6, 2) == 1
    allocate (sides%start(n + 1))
    do pass = 1, 2
      entries = 0
      do i = 1, n
        sides%start(i) = int(entries + 1, i4)
        call share_faces(body, faces, keys(i), share, there)
        do k = 1, body%n_slots
          if (.not. there(k)) cycle
          entries = entries + 1
          if (pass == 1) cycle
          sides%slot(entries) = int(k, i4)
          sides%face(entries) = body%volume(k)/body%spacing(k)
          sides%area(sides%axis(i), entries) = sides%outward(i)*share(k)
        end do
      end do
      sides%start(n + 1) = int(entries + 1, i4)
      if (pass == 1) then
        allocate (sides%slot(entries), sides%face(entries))
        allocate (sides%area(body%dim, entries), source=0.0_wp)
      end if
    end do
  end subroutine find_sides

  !> The area of points that share the faces of a side; `there` are these and a third row, which
  !> the balance may change.
  subroutine share_faces(body, faces, key, share, there)
    type(body_type), intent(in) :: body
    type(faces_type), intent(in) :: faces
    integer, intent(in) :: key
    real(wp), allocatable, intent(out) :: share(:)
    logical, allocatable, intent(out) :: there(:)
    real(wp), parameter :: part(3) = [outermost_share, behind_share, 0.0_wp]
    integer :: f, i

    allocate (share(body%n_slots), source=0.0_wp)
    allocate (there(body%n_slots), source=.false.)
    do f = 1, faces%n
      if (faces%side(f) /= key) cycle
      do i = 1, 3
        if (faces%slot(i, f) == 0) cycle
        associate (k => faces%slot(i, f))
          there(k) = .true.
          share(k) = share(k) + part(i)*faces%area(f)
        end associate
      end do
    end do
  end subroutine share_faces

  !> All free parts of faces.
  subroutine find_faces(body, family, faces, alone)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(faces_type), intent(out) :: faces
    integer, intent(out) :: alone
    type(bonds_type) :: bonds, behind
    real(wp), allocatable :: outermost(:, :, :)
    real(wp) :: free, face
    integer :: k, c, s, b, pass, next(-1:1, body%dim), further(-1:1, body%dim)

    alone = 0
    call find_outermost(body, outermost)
    call allocate_bonds(family, bonds)
    call allocate_bonds(family, behind)
    do pass = 1, 2
      faces%n = 0
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call family%bonds_of(k, bonds)
        call next_points(body, bonds, k, next)
        do c = 1, body%dim
          do s = -1, 1, 2
            if (next(s, c) > 0) cycle
            free = 1 - covered(body, bonds, k, c, s)
            if (free <= near) cycle
            if (next(-s, c) == 0) then
              alone = k
              return
            end if
            faces%n = faces%n + 1
            if (pass == 1) cycle
            call family%bonds_of(next(-s, c), behind)
            call next_points(body, behind, next(-s, c), further)
            b = merge(0, int(body%body(k)), body%layer(k) > 0)
            face = s*body%x(k, c) + body%spacing(k)/2
            faces%slot(:, faces%n) = int([k, next(-s, c), further(-s, c)], i4)
            faces%area(faces%n) = free*body%volume(k)/body%spacing(k)
            faces%side(faces%n) = 12*b + 2*(c - 1) + (s + 1)/2
            if (b > 0) then
              if (face > outermost(b, c, s) - near*body%spacing(k)) &
                & faces%side(faces%n) = faces%side(faces%n) + 6
            end if
          end do
        end do
      end do
      if (pass == 1) allocate (faces%side(faces%n), faces%slot(3, faces%n), faces%area(faces%n))
    end do
  end subroutine find_faces

  !> The outermost faces of each body without its layers, (bodies, dim, -1:1) along the normals.
  subroutine find_outermost(body, outermost)
    type(body_type), intent(in) :: body
    real(wp), allocatable, intent(out) :: outermost(:, :, :)
    integer :: k, c, s

    allocate (outermost(maxval(body%body), body%dim, -1:1), source=-huge(1.0_wp))
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      if (body%layer(k) > 0) cycle
      do s = -1, 1, 2
        do c = 1, body%dim
          associate (place => outermost(body%body(k), c, s))
            place = max(place, s*body%x(k, c) + body%spacing(k)/2)
          end associate
        end do
      end do
    end do
  end subroutine find_outermost

  !> The part of a face that cells of other grids cover [-].
  pure real(wp) function covered(body, bonds, k, axis, outward) result(part)
    type(body_type), intent(in) :: body
    type(bonds_type), intent(in) :: bonds   ! of slot `k`
    integer, intent(in) :: k, axis, outward
    real(wp) :: common
    integer :: i, c

    part = 0.0_wp
    do i = 1, bonds%n
      associate (j => bonds%j(i), h => body%spacing(k), other => body%spacing(bonds%j(i)), &
        & xi => bonds%xi(i, :))
        if (body%grid(j) == body%grid(k)) cycle
        if (abs(outward*xi(axis) - (h + other)/2) > near*h) cycle
        common = 1.0_wp
        do c = 1, body%dim
          if (c == axis) cycle
          common = common*max(0.0_wp, min(h/2, xi(c) + other/2) - max(-h/2, xi(c) - other/2))/h
        end do
        part = part + common
      end associate
    end do
  end function covered

end module pd_family_free_faces
